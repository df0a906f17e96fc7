//! L5: the command line, one file per verb. Exit 0, 1 (the work failed), 2 (bad usage).

mod app;
mod bench;
mod certificate;
mod compare;
mod convert;
mod demo;
mod export;
mod info;
mod render;
mod slice;
mod surface;
mod view;
mod warp;

use std::io::Write;
use std::panic::catch_unwind;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::evaluate::picture::Backend;

/// Sculpt a volume: pull and bend a CT scan, a simulation or a painted 3D texture like clay, without losing its inside.
#[derive(Parser)]
#[command(name = "voxclay", version)]
struct Cli {
    /// Print one JSON object on stdout and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    /// Worker threads (default: all cores).
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Subcommand)]
enum Verb {
    App(app::Args),
    Info(info::Args),
    Convert(convert::Args),
    Slice(slice::Args),
    Render(render::Args),
    Warp(warp::Args),
    Export(export::Args),
    Surface(surface::Args),
    Compare(compare::Args),
    Demo(demo::Args),
    Bench(bench::Args),
}

/// What a verb has to say: the JSON object of the contract, and the same for people.
struct Answer {
    json: serde_json::Value,
    text: String,
}

/// Opens the modeller on files; the window is not the command line's.
pub type OpenWindow = fn(Vec<String>, Backend) -> Result<(), String>;

/// Parses the arguments, runs the verb, and says what went wrong in one sentence. Without a verb the window opens.
pub fn main(open: OpenWindow) -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => {
            let usage = e.use_stderr();
            // the terminal may be gone; there is nobody left to tell
            let _ = e.print();
            return ExitCode::from(if usage { 2 } else { 0 });
        }
    };
    if let Some(n) = cli.threads
        && let Err(e) = rayon::ThreadPoolBuilder::new().num_threads(n.into()).build_global()
    {
        eprintln!("voxclay: cannot start {n} threads: {e}");
        return ExitCode::from(1);
    }
    let verb = match cli.verb {
        Some(Verb::App(args)) => return window(&args, open),
        None => return window(&app::Args::default(), open),
        Some(verb) => verb,
    };
    // a panic is our bug, but a user gets a sentence, not a backtrace
    std::panic::set_hook(Box::new(|_| {}));
    match catch_unwind(|| run(&verb)) {
        Ok(Ok(answer)) => {
            let line = if cli.json { format!("{}\n", answer.json) } else { answer.text };
            // a closed pipe (`voxclay info x | head`) is not a failure
            let _ = std::io::stdout().write_all(line.as_bytes());
            ExitCode::SUCCESS
        }
        Ok(Err(e)) => {
            eprintln!("voxclay: {e:#}");
            ExitCode::from(1)
        }
        Err(cause) => {
            let what = cause
                .downcast_ref::<String>()
                .map(String::as_str)
                .or_else(|| cause.downcast_ref::<&str>().copied())
                .unwrap_or("no message");
            eprintln!("voxclay: internal error ({what}); please report it with the command you ran");
            ExitCode::from(1)
        }
    }
}

/// The modeller has its own ways to say what went wrong; only that it cannot begin is said here.
fn window(args: &app::Args, open: OpenWindow) -> ExitCode {
    match app::run(args, open) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("voxclay: {e:#}");
            ExitCode::from(1)
        }
    }
}

fn run(verb: &Verb) -> anyhow::Result<Answer> {
    match verb {
        // has no answer: it was opened before
        Verb::App(_) => Ok(Answer { json: serde_json::Value::Null, text: String::new() }),
        Verb::Info(args) => info::run(args),
        Verb::Convert(args) => convert::run(args),
        Verb::Slice(args) => slice::run(args).map(|json| Answer { text: format!("{json:#}\n"), json }),
        Verb::Render(args) => render::run(args),
        Verb::Warp(args) => warp::run(args),
        Verb::Export(args) => export::run(args),
        Verb::Surface(args) => surface::run(args),
        Verb::Compare(args) => compare::run(args),
        Verb::Demo(args) => demo::run(args),
        Verb::Bench(args) => bench::run(args),
    }
}
