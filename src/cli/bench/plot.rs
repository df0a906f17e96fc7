//! Lines over two axes, as SVG.

use std::fmt::Write as _;

/// Points from left to right.
pub struct Line<'a> {
    pub name: &'a str,
    pub points: Vec<(f64, f64)>,
}

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 440.0;
/// Left, right, top and bottom of the field.
const FIELD: [f64; 4] = [72.0, 604.0, 56.0, 384.0];
/// Told apart also without colour vision (Okabe and Ito).
const COLORS: [&str; 6] = ["#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];

/// A plot from zero on both axes.
pub fn plot(title: &str, x_axis: &str, y_axis: &str, lines: &[Line]) -> String {
    let points = || lines.iter().flat_map(|l| &l.points);
    let (x_step, x_end) = ticks(points().map(|p| p.0).fold(0.0, f64::max));
    let (y_step, y_end) = ticks(points().map(|p| p.1).fold(0.0, f64::max));
    let [left, right, top, bottom] = FIELD;
    let x = |v: f64| left + (right - left) * v / x_end;
    let y = |v: f64| bottom - (bottom - top) * v / y_end;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n\
         <text x=\"{left}\" y=\"32\" font-size=\"16\">{title}</text>\n"
    );
    let mut count = 0;
    while f64::from(count) * y_step <= y_end * 1.0001 {
        let v = f64::from(count) * y_step;
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {0:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\">{v}</text>",
            y(v),
            left - 8.0,
            y(v) + 4.5
        );
        count += 1;
    }
    count = 0;
    while f64::from(count) * x_step <= x_end * 1.0001 {
        let v = f64::from(count) * x_step;
        let _ = writeln!(
            svg,
            "<path d=\"M{0:.1} {bottom}v5\" stroke=\"#888\"/><text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\">{v}</text>",
            x(v),
            bottom + 20.0
        );
        count += 1;
    }
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{x_axis}</text><text x=\"{left}\" y=\"{}\" text-anchor=\"middle\">{y_axis}</text>",
        0.5 * (left + right),
        bottom + 42.0,
        top - 8.0
    );
    // names beside the last points, kept apart
    let mut names: Vec<(f64, usize)> =
        lines.iter().enumerate().filter_map(|(i, l)| Some((y(l.points.last()?.1), i))).collect();
    names.sort_by(|a, b| a.0.total_cmp(&b.0));
    for i in 1..names.len() {
        names[i].0 = names[i].0.max(names[i - 1].0 + 18.0);
    }
    for (i, line) in lines.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        let path: Vec<String> = line.points.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            path.join(" ")
        );
        for p in &line.points {
            let _ = writeln!(svg, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"{color}\"/>", x(p.0), y(p.1));
        }
        if let Some((at, _)) = names.iter().find(|n| n.1 == i) {
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" fill=\"{color}\">{}</text>",
                right + 12.0,
                at + 4.5,
                line.name
            );
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// A round step for four to eight marks up to `largest`, and the last mark.
fn ticks(largest: f64) -> (f64, f64) {
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let power = 10f64.powf((largest / 4.0).log10().floor());
    let step = [5.0, 2.0, 1.0].map(|s| s * power).into_iter().find(|s| largest / s >= 4.0).unwrap_or(power);
    (step, (largest / step).ceil() * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_round_and_few() {
        for i in 1..2000 {
            let largest = 0.013 * f64::from(i);
            let (step, end) = ticks(largest);
            assert!(end >= largest * 0.9999 && (3.9..=11.0).contains(&(end / step)), "{largest}: {step} {end}");
        }
    }

    #[test]
    fn points_lie_in_the_field() {
        let svg = plot("t", "x", "y", &[Line { name: "a", points: vec![(1.0, 2.0), (10.0, 7.0)] }]);
        assert!(svg.contains("<polyline") && svg.matches("<circle").count() == 2);
    }
}
