//! A certificate beside the volume that it is about.

use std::io::Write;
use std::path::Path;

use anyhow::Result;
use serde_json::json;

use super::Answer;
use crate::evaluate::certificate::Certificate;
use crate::io;

/// Writes the certificate with some facts of the answer (`keys`, those that it has), and adds its verdict to the answer.
pub fn attach(answer: &mut Answer, certificate: &Certificate, path: &Path, keys: &[&str]) -> Result<()> {
    let mut page = serde_json::to_value(certificate)?;
    for key in keys {
        page[*key] = answer.json[*key].clone();
    }
    io::write_atomic(path, |w| Ok(writeln!(w, "{page:#}")?))?;
    answer.json["certificate"] = json!(path.to_string_lossy());
    answer.json["sound"] = json!(certificate.sound);
    let verdict = if certificate.sound { "sound" } else { "not sound" };
    answer.text.push_str(&format!("  {}: {verdict}\n", path.display()));
    certificate.faults.iter().for_each(|f| answer.text.push_str(&format!("    {f}\n")));
    Ok(())
}
