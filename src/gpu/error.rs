/// Why the GPU could not do what it was asked. Each message is one plain sentence.
#[derive(Debug, Clone, thiserror::Error)]
pub enum GpuError {
    /// No adapter of the wanted kind.
    #[error(
        "no {wanted} was found; install a Vulkan driver (Mesa's lavapipe does without a graphics card) or use --backend cpu"
    )]
    NoAdapter { wanted: &'static str },
    /// The adapter is there, but refused to open.
    #[error("the graphics adapter {adapter} could not be opened: {reason}")]
    Refused { adapter: String, reason: String },
    /// The adapter lacks something that there is no way round.
    #[error("the graphics adapter {adapter} cannot do this: {missing}")]
    Lacking { adapter: String, missing: String },
    /// Larger than the adapter allows, known before anything is allocated.
    #[error("{what} of {size} is larger than the {limit} that this graphics adapter allows; use --backend cpu")]
    TooLarge { what: &'static str, size: String, limit: String },
    /// An allocation failed.
    #[error("the graphics adapter has no memory left for {what} ({bytes} bytes); use --backend cpu")]
    OutOfMemory { what: &'static str, bytes: u64 },
    /// The device went away: driver reset, unplugged, or too long a job.
    #[error("the graphics device was lost: {0}")]
    Lost(String),
    /// wgpu refused a call: a mistake of ours.
    #[error("the graphics library refused a call, which is a mistake in Voxclay: {0}")]
    Refusal(String),
}
