//! Files of words, such as numbers in text, among which there may be stretches of bytes.

use std::borrow::Cow;
use std::str::FromStr;

/// What is left of a file, read word by word, with the line that the last word stands in.
#[derive(Clone)]
pub(super) struct Words<'a> {
    rest: &'a [u8],
    pub line: usize,
}

impl<'a> Words<'a> {
    pub fn new(text: &'a [u8], line: usize) -> Self {
        Self { rest: text, line }
    }

    pub fn next_word(&mut self) -> Option<&'a [u8]> {
        let blank = self.rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(self.rest.len());
        self.line += self.rest[..blank].iter().filter(|&&b| b == b'\n').count();
        self.rest = &self.rest[blank..];
        let len = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(len);
        self.rest = rest;
        (len > 0).then_some(word)
    }

    /// The next word, which is read again afterwards.
    pub fn peek(&self) -> Option<&'a [u8]> {
        self.clone().next_word()
    }

    pub fn skip_line(&mut self) {
        let len = self.rest.iter().position(|&b| b == b'\n').unwrap_or(self.rest.len());
        self.rest = &self.rest[len..];
    }

    /// The rest of the line without its end, which is passed.
    pub fn rest_of_line(&mut self) -> &'a [u8] {
        let before = self.rest;
        self.skip_line();
        let line = &before[..before.len() - self.rest.len()];
        if let Some((_, after)) = self.rest.split_first() {
            self.rest = after;
            self.line += 1;
        }
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// The next `count` bytes, whatever they are.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (bytes, rest) = self.rest.split_at_checked(count).ok_or("the file breaks off in its data")?;
        self.line += bytes.iter().filter(|&&b| b == b'\n').count();
        self.rest = rest;
        Ok(bytes)
    }

    /// Goes on behind the next `mark`; what lies before it is passed over. `false` if there is none.
    pub fn skip_past(&mut self, mark: &[u8]) -> bool {
        let mut from = 0;
        while let Some(at) = self.rest[from..].iter().position(|b| *b == mark[0]) {
            from += at;
            if self.rest[from..].starts_with(mark) {
                self.line += self.rest[..from].iter().filter(|&&b| b == b'\n').count();
                self.rest = &self.rest[from + mark.len()..];
                return true;
            }
            from += 1;
        }
        false
    }

    /// Bytes that are left.
    pub fn left(&self) -> usize {
        self.rest.len()
    }

    /// A number of things for which there must be room in what is left of the file, `least` bytes for each.
    pub fn room(&self, count: u64, least: u64, things: &str) -> Result<usize, String> {
        // the last number of a text may stand without a blank behind it
        if count.saturating_mul(least) > self.rest.len() as u64 + 1 {
            let left = self.rest.len();
            return Err(format!("it says that it has {count} {things}, but only {left} bytes follow"));
        }
        Ok(count as usize)
    }

    /// The next word as a number; the error says what stands there instead.
    pub fn number(&mut self) -> Result<f64, String> {
        self.parse("a number")
    }

    /// The next word as a whole number.
    pub fn whole<T: FromStr>(&mut self) -> Result<T, String> {
        self.parse("a whole number")
    }

    pub fn parse<T: FromStr>(&mut self, what: &str) -> Result<T, String> {
        let line = self.line;
        let word =
            self.next_word().ok_or_else(|| format!("the file breaks off at line {line}; {what} should follow"))?;
        let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        value.ok_or_else(|| format!("line {} has '{}' where {what} should stand", self.line, show(word)))
    }
}

/// A text whose comments, from `#` to the end of the line, are blank, so that lines keep their numbers.
pub(super) fn without_comments(text: &[u8]) -> Cow<'_, [u8]> {
    if !text.contains(&b'#') {
        return text.into();
    }
    let mut comment = false;
    let blank = text.iter().map(|&b| {
        comment = b != b'\n' && (comment || b == b'#');
        if comment { b' ' } else { b }
    });
    blank.collect::<Vec<u8>>().into()
}

pub(super) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A word of a file for a message: printable and short.
pub(super) fn show(word: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(word).chars().filter(|c| !c.is_control()).collect();
    match text.char_indices().nth(24) {
        Some((cut, _)) => format!("{}...", &text[..cut]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_count_lines() {
        let mut w = Words::new(b" solid\tx\r\n\n 1e3 no", 1);
        assert_eq!(w.next_word(), Some(&b"solid"[..]));
        w.skip_line();
        assert_eq!((w.number(), w.line), (Ok(1000.0), 3));
        assert_eq!(w.number(), Err("line 3 has 'no' where a number should stand".to_owned()));
        assert!(w.number().is_err_and(|e| e.contains("breaks off")));
    }

    #[test]
    fn bytes_among_words() {
        let mut w = Words::new(b"data 3 \r\n\n\0\ntail $$End\nx", 1);
        assert_eq!((w.next_word(), w.whole::<u32>()), (Some(&b"data"[..]), Ok(3)));
        assert_eq!((w.rest_of_line(), w.line), (&b" "[..], 2));
        assert_eq!((w.take(3), w.line), (Ok(&b"\n\0\n"[..]), 4));
        assert!(w.skip_past(b"$End") && !w.skip_past(b"$End"));
        assert_eq!((w.rest_of_line(), w.peek(), w.next_word()), (&b""[..], Some(&b"x"[..]), Some(&b"x"[..])));
        assert_eq!((w.left(), w.take(1).is_err(), w.rest_of_line()), (0, true, &b""[..]));
    }

    #[test]
    fn comments_become_blank() {
        assert_eq!(*without_comments(b"a # b\n#\nc#d"), *b"a    \n \nc  ");
        assert!(matches!(without_comments(b"a b\n"), Cow::Borrowed(b"a b\n")));
    }

    #[test]
    fn a_count_needs_room() {
        let w = Words::new(b"1 2 3", 1);
        assert_eq!(w.room(3, 2, "numbers"), Ok(3));
        let message = w.room(u64::MAX, 2, "numbers").expect_err("refused");
        assert_eq!(message, "it says that it has 18446744073709551615 numbers, but only 5 bytes follow");
    }
}
