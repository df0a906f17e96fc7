//! `voxclay`: dispatch only.

fn main() -> std::process::ExitCode {
    voxclay::cli::main()
}
