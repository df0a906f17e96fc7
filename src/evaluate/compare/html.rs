//! The comparison as one page that needs nothing beside it.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{Comparison, Pair, Refinement, STEP, Way};
use crate::render::{Picture, PictureError};

const STYLE: &str = r#"
:root { color-scheme: dark; --ground: #17191c; --panel: #212428; --line: #2c3035; --text: #d9dcdf; --dim: #8b9299; --accent: #e8a33d; --cool: #6ba3e0 }
* { box-sizing: border-box }
body { margin: 0; background: var(--ground); color: var(--text); font: 15px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif }
main { max-width: 1180px; margin: 0 auto; padding: 40px 24px 80px }
h1 { font-size: 26px; font-weight: 600; margin: 0 0 4px }
h2 { font-size: 18px; font-weight: 600; margin: 48px 0 8px }
p { margin: 8px 0; max-width: 76ch }
.dim, figcaption, th, .facts { color: var(--dim) }
.facts { font-size: 13px }
.scroll { overflow-x: auto; background: var(--panel); border-radius: 8px; margin: 16px 0 }
table { border-collapse: collapse; width: 100%; font-size: 13px; font-variant-numeric: tabular-nums }
th { font-weight: 500; text-align: right; vertical-align: bottom; padding: 10px 12px 6px; white-space: nowrap }
td { text-align: right; padding: 5px 12px; border-top: 1px solid var(--line); white-space: nowrap }
th:first-child, td:first-child, th:nth-child(2), td:nth-child(2) { text-align: left }
tr.first td { border-top: 1px solid #454b52 }
.good { color: var(--accent) }
.pair { display: grid; grid-template-columns: 1fr 1fr; gap: 12px; margin: 20px 0 0 }
figure { margin: 0; min-width: 0 }
img { display: block; width: 100%; border-radius: 6px }
figcaption { font-size: 13px; margin-top: 6px }
figcaption b { color: var(--text); font-weight: 500 }
svg { display: block; max-width: 760px; width: 100%; background: var(--panel); border-radius: 8px; margin: 16px 0 }
svg text { fill: var(--dim); font-size: 12px; font-variant-numeric: tabular-nums }
"#;

/// The report, self-contained: tables, a chart of the convergence, and for each mode its picture beside its difference from
/// the reference. `title` and `facts` (a name and a value each) say what was compared.
///
/// # Errors
/// If a picture cannot be encoded.
pub fn html(comparison: &Comparison, title: &str, facts: &[(String, String)]) -> Result<String, PictureError> {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{0}: modes compared</title><style>{STYLE}</style></head><body><main>\n<h1>Modes compared</h1>\n<p class=\"facts\">{0}",
        escape(title)
    );
    for (name, value) in facts {
        let _ = write!(page, " &middot; {} {}", escape(name), escape(value));
    }
    page.push_str("</p>\n");
    for sentence in findings(comparison) {
        let _ = writeln!(page, "<p>{sentence}</p>");
    }
    page.push_str(&chart(&comparison.pairs));
    page.push_str(&pictures_table(&comparison.pairs));
    if comparison.pairs.iter().any(|p| p.volume.is_some()) {
        page.push_str(&volumes_table(comparison));
    }
    gallery(&mut page, comparison)?;
    page.push_str("</main></body></html>\n");
    Ok(page)
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// What the numbers say, in sentences.
fn findings(comparison: &Comparison) -> Vec<String> {
    let mut found = Vec::new();
    for (mode, what) in [("slicing", "depth of subdivision"), ("tets", "level of the lattice")] {
        let falls: Vec<String> = comparison
            .pairs
            .iter()
            .filter(|p| p.way.mode() == mode)
            .filter_map(|p| p.falls.map(|f| format!("{:.1}", f[1])))
            .collect();
        if !falls.is_empty() {
            found.push(format!(
                "<b>{mode}</b>: with each {what} the mean error of the coordinates falls by {}. Second order is 4.",
                falls.join(", ")
            ));
        }
    }
    let adaptive = |p: &&Pair| matches!(p.way, Way::Tets(Refinement::Tolerance(_)));
    if let Some((pair, v)) = comparison.pairs.iter().find(adaptive).and_then(|p| Some((p, p.volume?))) {
        found.push(format!(
            "<b>tets, {}</b> against the reference volume, inside: root mean square {} of the range, largest {}; {} of the \
             voxels differ by more than 1/255.",
            pair.way.setting(),
            steps(v.interior.rms),
            steps(v.interior.max),
            percent(v.interior.above),
        ));
    }
    found
}

fn pictures_table(pairs: &[Pair]) -> String {
    let mut text = String::from(
        "<h2>Pictures</h2>\n<p class=\"dim\">Against the map evaluated in 64 bits at every fragment. RMSE and max in steps of \
         255. Coordinate errors in voxels, with how they fell from the row before.</p>\n<div class=\"scroll\"><table><tr>\
         <th>mode</th><th>setting</th><th>triangles</th><th>RMSE</th><th>PSNR dB</th><th>SSIM</th><th>max</th>\
         <th>coordinate max</th><th>fell by</th><th>mean</th><th>fell by</th><th>ms / frame</th><th>ms / change</th></tr>\n",
    );
    let mut last = "";
    for p in pairs {
        let class = if p.way.mode() == last { "" } else { " class=\"first\"" };
        last = p.way.mode();
        let d = &p.difference;
        let [max, mean] = p.coordinate.map_or([None; 2], |c| [Some(c.max), Some(c.mean)]).map(voxels);
        let [a, b] = p.falls.map_or([None; 2], |f| f.map(Some)).map(fell);
        let _ = writeln!(
            text,
            "<tr{class}><td>{}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{}</td><td>{:.5}</td><td>{:.0}</td>\
             <td>{max}</td><td>{a}</td><td>{mean}</td><td>{b}</td><td>{}</td><td>{}</td></tr>",
            p.way.mode(),
            p.way.setting(),
            grouped(p.triangles),
            d.rmse,
            decibels(d.psnr),
            d.ssim,
            d.max,
            ms(p.ms.frame),
            ms(p.ms.change),
        );
    }
    text + "</table></div>\n"
}

fn volumes_table(comparison: &Comparison) -> String {
    let [lo, hi] = comparison.range;
    let mut text = format!(
        "<h2>Resampled volumes</h2>\n<p class=\"dim\">Against the map evaluated in 64 bits at every voxel; RMSE and max in \
         values, of which the input has {lo} to {hi}. <i>Inside</i>: where the value comes from at least half a voxel within \
         the input, as parts of the range, and how many voxels differ by more than 1/255 of it. <i>Drawn</i>: the picture against \
         that of the reference volume, in steps of 255.</p>\n<div class=\"scroll\"><table><tr><th>mode</th><th>setting</th>\
         <th>tetrahedra</th><th>RMSE</th><th>PSNR dB</th><th>SSIM</th><th>max</th><th>inside RMS</th><th>inside max</th>\
         <th>above 1/255</th><th>drawn RMSE</th><th>drawn max</th></tr>\n"
    );
    let mut last = "";
    for (p, v) in comparison.pairs.iter().filter_map(|p| Some((p, p.volume?))) {
        let class = if p.way.mode() == last { "" } else { " class=\"first\"" };
        last = p.way.mode();
        let good = if v.interior.rms < STEP { " class=\"good\"" } else { "" };
        let _ = writeln!(
            text,
            "<tr{class}><td>{}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{}</td><td>{:.5}</td><td>{:.0}</td>\
             <td{good}>{}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{:.0}</td></tr>",
            p.way.mode(),
            p.way.setting(),
            p.tets.map(grouped).unwrap_or_default(),
            v.all.rmse,
            decibels(v.all.psnr),
            v.all.ssim,
            v.all.max,
            steps(v.interior.rms),
            steps(v.interior.max),
            percent(v.interior.above),
            v.drawn.rmse,
            v.drawn.max,
        );
    }
    text + "</table></div>\n"
}

fn gallery(page: &mut String, comparison: &Comparison) -> Result<(), PictureError> {
    let _ = writeln!(
        page,
        "<h2>Side by side</h2>\n<p class=\"dim\">Left the mode, right its largest difference from the reference in any colour \
         channel, in steps of 255, on one logarithmic scale for all.</p>\n<div class=\"pair\">{}</div>",
        figure(&comparison.reference, "<b>Reference</b>: the map in 64 bits at every fragment")?
    );
    for p in &comparison.pairs {
        let (width, height, pixels) = p.map.drawn(comparison.scale);
        let map = Picture { width, height, pixels };
        let name = format!("<b>{}, {}</b>", p.way.mode(), p.way.setting());
        let said = format!(
            "PSNR {} dB, SSIM {:.5}, max {:.0}",
            decibels(p.difference.psnr),
            p.difference.ssim,
            p.difference.max
        );
        let _ = writeln!(page, "<div class=\"pair\">{}{}</div>", figure(&p.picture, &name)?, figure(&map, &said)?);
    }
    Ok(())
}

fn figure(picture: &Picture, caption: &str) -> Result<String, PictureError> {
    let data = STANDARD.encode(picture.png()?);
    Ok(format!(
        "<figure><img alt=\"\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
    ))
}

/// Errors of the coordinates over the level, with a line of second order beside them.
fn chart(pairs: &[Pair]) -> String {
    type Series = Vec<(f64, [f64; 2])>;
    let series = |mode: &str| -> Series {
        let of = |p: &Pair| match p.way {
            Way::Slicing(Refinement::Depth(d)) | Way::Tets(Refinement::Depth(d)) if p.way.mode() == mode => {
                p.coordinate.filter(|c| c.mean > 0.0).map(|c| (f64::from(d), [c.max, c.mean]))
            }
            _ => None,
        };
        pairs.iter().filter_map(of).collect()
    };
    let all = [("slicing", "#e8a33d", series("slicing")), ("tets", "#6ba3e0", series("tets"))];
    let points = || all.iter().flat_map(|s| &s.2);
    if points().count() < 2 {
        return String::new();
    }
    let levels = points().map(|p| p.0).fold(1.0, f64::max);
    let decade = |v: f64| v.log10();
    let (lo, hi) = points().flat_map(|p| p.1).map(decade).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    let (lo, hi) = (lo.floor(), hi.ceil().max(lo.floor() + 1.0));
    let (left, right, top, bottom) = (64.0, 560.0, 24.0, 330.0);
    let x = |level: f64| left + 12.0 + (right - left - 24.0) * level / levels;
    let y = |v: f64| bottom - (bottom - top) * (decade(v) - lo) / (hi - lo);
    let mut svg = String::from("<h2>Convergence</h2>\n<svg viewBox=\"0 0 760 376\" role=\"img\">\n");
    let line = |svg: &mut String, points: &[(f64, f64)], style: &str| {
        let list: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(svg, "<polyline points=\"{}\" fill=\"none\" {style}/>", list.join(" "));
    };
    for d in lo as i32..=hi as i32 {
        let at = y(10f64.powi(d));
        line(&mut svg, &[(left, at), (right, at)], "stroke=\"#2c3035\"");
        let number = if d < -3 { format!("1e{d}") } else { format!("{}", 10f64.powi(d)) };
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{number}</text>", left - 8.0, at + 4.0);
    }
    for level in 0..=levels as u32 {
        let at = x(level.into());
        let _ = writeln!(svg, "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{level}</text>", bottom + 20.0);
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">subdivision depth, lattice level</text>\
         <text x=\"{left}\" y=\"14\">coordinate error, voxels</text>",
        (left + right) / 2.0,
        bottom + 40.0
    );
    // a quarter a level, from the middle of the range
    let start = 10f64.powf(hi - 0.25);
    let end = levels.min((hi - 0.25 - lo) / 4f64.log10());
    let guide = [(x(0.0), y(start)), (x(end), y(start / 4f64.powf(end)))];
    line(&mut svg, &guide, "stroke=\"#8b9299\" stroke-dasharray=\"2 5\"");
    let mut at = top + 12.0;
    let mut legend = |svg: &mut String, style: &str, text: &str| {
        line(svg, &[(right + 20.0, at), (right + 52.0, at)], style);
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\">{text}</text>", right + 60.0, at + 4.0);
        at += 22.0;
    };
    for (mode, color, series) in &all {
        for (which, name, dash) in [(0, "largest", ""), (1, "mean", " stroke-dasharray=\"7 4\"")] {
            if series.is_empty() {
                continue;
            }
            let style = format!("stroke=\"{color}\" stroke-width=\"2\"{dash}");
            let points: Vec<(f64, f64)> = series.iter().map(|(l, e)| (x(*l), y(e[which]))).collect();
            line(&mut svg, &points, &style);
            for (px, py) in &points {
                let _ = writeln!(svg, "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3\" fill=\"{color}\"/>");
            }
            legend(&mut svg, &style, &format!("{mode}, {name}"));
        }
    }
    legend(&mut svg, "stroke=\"#8b9299\" stroke-dasharray=\"2 5\"", "a quarter a level");
    svg + "</svg>\n"
}

fn decibels(psnr: f64) -> String {
    if psnr.is_infinite() { "equal".to_owned() } else { format!("{psnr:.1}") }
}

/// A part of the range, in steps of 1/255.
fn steps(part: f64) -> String {
    format!("{:.2}/255", part * 255.0)
}

fn percent(part: f64) -> String {
    format!("{:.2} %", 100.0 * part)
}

fn voxels(error: Option<f64>) -> String {
    error.map_or(String::new(), |e| if e < 1e-3 { format!("{e:.1e}") } else { format!("{e:.4}") })
}

fn fell(factor: Option<f64>) -> String {
    factor.map_or(String::new(), |f| format!("{f:.2}"))
}

fn ms(ms: f64) -> String {
    if ms < 10.0 { format!("{ms:.1}") } else { format!("{ms:.0}") }
}

/// A count with narrow gaps between its thousands.
fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(d);
    }
    text
}
