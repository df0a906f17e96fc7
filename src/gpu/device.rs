//! The device: which adapter, what it can do, and what became of the calls.
//!
//! wgpu reports most mistakes and failures late, to a callback that by default panics. Here they are kept, and
//! [`Gpu::check`] hands the first one out as a [`GpuError`]; every function that waits for the device calls it.

use std::sync::{Arc, Mutex, PoisonError};

use super::GpuError;

/// How long a finished mapping may take to be reported by the thread that polled it.
const HAND_OVER: std::time::Duration = std::time::Duration::from_secs(10);

/// Which adapter to open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Preference {
    /// The fastest kind there is; a software adapter where there is no other.
    #[default]
    Any,
    /// A software adapter, so that pictures do not depend on the graphics card.
    Software,
}

impl Preference {
    /// Smaller is better; `None` if the kind will not do.
    fn rank(self, kind: wgpu::DeviceType) -> Option<u32> {
        use wgpu::DeviceType as D;
        match (self, kind) {
            (Self::Any, D::DiscreteGpu) => Some(0),
            (Self::Any, D::IntegratedGpu) => Some(1),
            (Self::Any, D::VirtualGpu) => Some(2),
            (Self::Any, D::Other) => Some(3),
            (Self::Any, D::Cpu) => Some(4),
            (Self::Software, D::Cpu) => Some(0),
            (Self::Software, _) => None,
        }
    }
}

/// What the adapter offers beyond the basics, and Voxclay uses where it can.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capabilities {
    /// 16-bit normalised textures: u16 volumes stay as they are.
    pub unorm16: bool,
    /// 32-bit float textures can be filtered: f32 volumes stay as they are.
    pub filter_float32: bool,
    /// Timestamps at the start and end of passes.
    pub timestamps: bool,
    /// Invocations of fragment shaders can be counted.
    pub statistics: bool,
    /// Fragments that write a depth can be left out by a bound of it.
    pub early_depth: bool,
}

impl Capabilities {
    fn of(features: wgpu::Features) -> Self {
        Self {
            unorm16: features.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM),
            filter_float32: features.contains(wgpu::Features::FLOAT32_FILTERABLE),
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            statistics: features.contains(wgpu::Features::PIPELINE_STATISTICS_QUERY),
            early_depth: features.contains(wgpu::Features::SHADER_EARLY_DEPTH_TEST),
        }
    }
}

/// The first failure reported by the device since it was opened.
#[derive(Debug, Default)]
struct Failure(Mutex<Option<GpuError>>);

impl Failure {
    fn report(&self, error: GpuError) {
        let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // a lost device causes many refusals: the loss is what the user must hear of
        if slot.is_none() || matches!(error, GpuError::Lost(_)) {
            *slot = Some(error);
        }
    }

    fn get(&self) -> Option<GpuError> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// An open graphics device.
#[derive(Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    capabilities: Capabilities,
    limits: wgpu::Limits,
    info: wgpu::AdapterInfo,
    failure: Arc<Failure>,
}

impl Gpu {
    /// Opens the best adapter of the wanted kind with all its limits and the features that Voxclay uses.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] or [`GpuError::Refused`].
    pub fn open(preference: Preference) -> Result<Self, GpuError> {
        Self::open_without(preference, wgpu::Features::empty())
    }

    /// The same, but without some of the optional features: for tests of the ways round them.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_plain(preference: Preference) -> Result<Self, GpuError> {
        Self::open_without(preference, wgpu::Features::all())
    }

    fn open_without(preference: Preference, avoid: wgpu::Features) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
            .into_iter()
            .filter_map(|a| Some((preference.rank(a.get_info().device_type)?, a)))
            .min_by_key(|(rank, _)| *rank)
            .map(|(_, a)| a)
            .ok_or(GpuError::NoAdapter {
                wanted: match preference {
                    Preference::Any => "graphics adapter",
                    Preference::Software => "software graphics adapter",
                },
            })?;
        let info = adapter.get_info();
        let wanted = wgpu::Features::TEXTURE_FORMAT_16BIT_NORM
            | wgpu::Features::SHADER_EARLY_DEPTH_TEST
            | wgpu::Features::FLOAT32_FILTERABLE
            | wgpu::Features::FLOAT32_BLENDABLE
            | wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::PIPELINE_STATISTICS_QUERY;
        let features = adapter.features() & (wanted - avoid);
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("voxclay"),
            required_features: features,
            required_limits: limits.clone(),
            // few, large allocations: volumes and slice geometry
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        }))
        .map_err(|e| GpuError::Refused { adapter: info.name.clone(), reason: e.to_string() })?;

        let failure = Arc::new(Failure::default());
        let seen = failure.clone();
        device.on_uncaptured_error(Arc::new(move |e| {
            seen.report(match e {
                wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory { what: "a frame", bytes: 0 },
                other => GpuError::Refusal(other.to_string()),
            });
        }));
        let seen = failure.clone();
        device.set_device_lost_callback(move |reason, message| {
            // `Destroyed` is what dropping the device reports
            if reason != wgpu::DeviceLostReason::Destroyed {
                seen.report(GpuError::Lost(message));
            }
        });
        Ok(Self { device, queue, capabilities: Capabilities::of(features), limits, info, failure })
    }

    /// Name of the adapter and its driver, for reports.
    pub fn name(&self) -> String {
        let driver = [self.info.driver.as_str(), self.info.driver_info.as_str()].join(" ");
        format!("{} ({:?}, {})", self.info.name, self.info.backend, driver.trim())
    }

    /// Whether the adapter draws on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    pub fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    pub fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// # Errors
    /// The first failure that the device reported.
    pub fn check(&self) -> Result<(), GpuError> {
        self.failure.get().map_or(Ok(()), Err)
    }

    /// Runs what allocates `bytes` for `what`, and turns a failure into an error that says so.
    pub(crate) fn allocate<T>(&self, what: &'static str, bytes: u64, make: impl FnOnce() -> T) -> Result<T, GpuError> {
        let refused = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        let memory = pollster::block_on(memory.pop());
        let refused = pollster::block_on(refused.pop());
        if memory.is_some() {
            return Err(GpuError::OutOfMemory { what, bytes });
        }
        if let Some(e) = refused {
            return Err(GpuError::Refusal(e.to_string()));
        }
        Ok(made)
    }

    /// Waits until everything submitted is done.
    ///
    /// # Errors
    /// The first failure that the device reported.
    pub fn wait(&self) -> Result<(), GpuError> {
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        polled.map(|_| ()).map_err(|e| GpuError::Lost(e.to_string()))
    }

    /// Waits for what was submitted, and hands the bytes of a mappable buffer to `with`.
    pub(crate) fn read<T>(&self, buffer: &wgpu::Buffer, with: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let (done, mapped) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |r| {
            // nobody listens any more if the wait below failed
            let _ = done.send(r);
        });
        self.wait()?;
        // where several threads wait for one device, another one may be about to hand this result over
        match mapped.recv_timeout(HAND_OVER) {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(GpuError::Lost(e.to_string())),
            Err(_) => return Err(GpuError::Lost("it did not finish its work".into())),
        }
        let view = buffer.get_mapped_range(..).map_err(|e| GpuError::Refusal(e.to_string()))?;
        let read = with(&view);
        drop(view);
        buffer.unmap();
        Ok(read)
    }
}
