//! Tells tests what lies beside the project and in the machine, so that they show as ignored where it does not.
//!
//! - `cfg(shared_data)`: the real data sets are in `../shared/data`.
//! - `cfg(gpu_adapter)`: a graphics driver is installed. On continuous integration (`CI` is set) it always holds: there
//!   the tests of the GPU must fail, not vanish, if the driver is missing.

use std::path::Path;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(shared_data)");
    println!("cargo::rerun-if-changed=../shared/data");
    if Path::new("../shared/data/README.md").exists() {
        println!("cargo::rustc-cfg=shared_data");
    }
    println!("cargo::rustc-check-cfg=cfg(gpu_adapter)");
    if gpu_adapter() {
        println!("cargo::rustc-cfg=gpu_adapter");
    }
}

fn gpu_adapter() -> bool {
    let named = ["CI", "VK_ICD_FILENAMES", "VK_DRIVER_FILES"].map(|name| {
        println!("cargo::rerun-if-env-changed={name}");
        std::env::var_os(name).is_some_and(|v| !v.is_empty())
    });
    // Metal and Direct3D 12 come with the system
    let built_in = matches!(std::env::var("CARGO_CFG_TARGET_OS").as_deref(), Ok("macos" | "windows"));
    // where the Vulkan loader looks for drivers
    let drivers = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"].map(|dir| {
        println!("cargo::rerun-if-changed={dir}");
        std::fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_some())
    });
    built_in || named.contains(&true) || drivers.contains(&true)
}
