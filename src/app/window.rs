use std::time::Duration;

use eframe::egui::{self, ViewportBuilder};

use super::modeller::Modeller;
use super::state::Start;

/// Opens the window and works until it is closed.
///
/// # Errors
/// If there is no display or no graphics adapter to draw the window with; the sentence says what else can be done.
pub fn run(start: Start) -> Result<(), String> {
    let options = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title("Voxclay")
            .with_app_id("voxclay")
            .with_inner_size([1360.0, 860.0])
            .with_min_inner_size([720.0, 480.0])
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: wgpu_options(),
        ..Default::default()
    };
    let app = move |cc: &eframe::CreationContext<'_>| -> Result<Box<dyn eframe::App>, _> {
        super::fonts::look_for_more(&cc.egui_ctx);
        Ok(Box::new(Window { modeller: Modeller::new(&cc.egui_ctx, start) }))
    };
    eframe::run_native("voxclay", options, Box::new(app)).map_err(|e| {
        let why = plain(&e);
        format!("the window could not be opened: {why}. `voxclay demo` and the other commands work without one")
    })
}

/// What went wrong, for those who do not know what the window is made with.
fn plain(error: &eframe::Error) -> String {
    match error {
        eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_) => {
            let named = |name: &str| std::env::var(name).ok().filter(|v| !v.is_empty());
            match named("WAYLAND_DISPLAY").or_else(|| named("DISPLAY")) {
                Some(display) => format!("the display {display} does not answer"),
                None => "there is no display".to_owned(),
            }
        }
        eframe::Error::Wgpu(_) => {
            "no graphics driver here can draw it; a Vulkan driver is needed, such as Mesa's".to_owned()
        }
        other => other.to_string(),
    }
}

/// Any adapter will do, also a software one: pictures come from the worker.
fn wgpu_options() -> eframe::egui_wgpu::WgpuConfiguration {
    use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    // the default asks for small limits, and views can be large
    setup.device_descriptor = std::sync::Arc::new(|adapter| wgpu::DeviceDescriptor {
        label: Some("window"),
        required_limits: adapter.limits(),
        ..Default::default()
    });
    WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..Default::default() }
}

struct Window {
    modeller: Modeller,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.modeller.ui(ui);
    }

    fn auto_save_interval(&self) -> Duration {
        Duration::from_secs(3600)
    }

    fn on_exit(&mut self) {
        self.modeller.closed();
    }
}
