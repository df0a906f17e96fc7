//! Tells tests whether the real data sets lie beside the project, so that they show as ignored where they do not.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(shared_data)");
    println!("cargo::rerun-if-changed=../shared/data");
    if std::path::Path::new("../shared/data/README.md").exists() {
        println!("cargo::rustc-cfg=shared_data");
    }
}
