use serde::{Deserialize, Serialize};

use super::{CameraSpec, Clip, Document, LookSpec, Placement, ProxySource, VolumeSource};
use crate::deform::{Deformation, Stack};
use crate::spline::paint::SmoothLook;
use crate::volume::transfer::TransferFunction;

/// One change of a document, as a window or a script asks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Edit {
    /// Another volume; the stack and everything else stays.
    SetVolume(VolumeSource),
    /// Another step of a series in time, counted from 0. Whether there is such a step is known where it is read.
    SetStep(usize),
    SetProxy(ProxySource),
    SetPlacement(Placement),
    /// Newest strokes, all in one step (a stroke and its mirror images).
    Push(Vec<Deformation>),
    /// Takes the place of the deformation with this index.
    Replace(usize, Deformation),
    /// As [`Edit::Replace`], for several at once.
    ReplaceAll(Stack),
    Remove(usize),
    /// A copy right above it.
    Duplicate(usize),
    /// From one place in the order to another.
    Move {
        from: usize,
        to: usize,
    },
    Rename(usize, String),
    Enable(usize, bool),
    SetAllowFolds(bool),
    /// A preset or file; the document's own function goes.
    SetTransfer(String),
    SetTransferFunction(#[serde(with = "text")] TransferFunction),
    SetLook(LookSpec),
    SetSurface(SmoothLook),
    SetClip(Clip),
    /// Not a step of the history: looking at something does not change it.
    SetCamera(CameraSpec),
}

mod text {
    use serde::{Deserialize, Deserializer, Serializer};

    use super::TransferFunction;

    pub fn serialize<S: Serializer>(t: &TransferFunction, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(t)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<TransferFunction, D::Error> {
        TransferFunction::parse(&String::deserialize(d)?).map_err(serde::de::Error::custom)
    }
}

/// Why an edit could not be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EditError {
    #[error("there is no deformation {index}; the stack has {count}, counted from 0")]
    NoSuchDeformation { index: usize, count: usize },
    #[error(transparent)]
    Transfer(#[from] crate::volume::transfer::TransferError),
}

impl Edit {
    /// What the history calls it.
    pub fn name(&self, document: &Document) -> String {
        let called = |i: usize| match document.stack.items.get(i).map(|d| d.name.as_str()) {
            None | Some("") => format!("stroke {}", i + 1),
            Some(name) => format!("'{name}'"),
        };
        match self {
            Self::SetVolume(_) => "Change the volume".to_owned(),
            Self::SetStep(step) => format!("Show step {step}"),
            Self::SetProxy(_) => "Change the shape".to_owned(),
            Self::SetPlacement(_) => "Place the shape".to_owned(),
            Self::Push(items) => match items.first() {
                Some(d) if !d.name.is_empty() => d.name.clone(),
                _ => "Stroke".to_owned(),
            },
            Self::Replace(i, _) => format!("Change {}", called(*i)),
            Self::ReplaceAll(_) => "Change the stack".to_owned(),
            Self::Remove(i) => format!("Delete {}", called(*i)),
            Self::Duplicate(i) => format!("Duplicate {}", called(*i)),
            Self::Move { from, .. } => format!("Move {}", called(*from)),
            Self::Rename(i, _) => format!("Rename {}", called(*i)),
            Self::Enable(i, on) => format!("Switch {} {}", if *on { "on" } else { "off" }, called(*i)),
            Self::SetAllowFolds(on) => if *on { "Let folds through" } else { "Hold folds back" }.to_owned(),
            Self::SetTransfer(name) => format!("Transfer function {name}"),
            Self::SetTransferFunction(_) => "Edit the transfer function".to_owned(),
            Self::SetLook(_) => "Change the look".to_owned(),
            Self::SetSurface(_) => "Change the surface".to_owned(),
            Self::SetClip(_) => "Clip the view".to_owned(),
            Self::SetCamera(_) => "Look from elsewhere".to_owned(),
        }
    }

    /// Whether a document before and after is another one to a user (it is not where only the view changed).
    pub fn is_step(&self) -> bool {
        !matches!(self, Self::SetCamera(_))
    }

    /// Edits of one kind on one thing that follow each other without a pause are one step: a slider being dragged.
    pub fn joins(&self, before: &Self) -> bool {
        match (self, before) {
            (Self::Replace(a, _), Self::Replace(b, _)) | (Self::Rename(a, _), Self::Rename(b, _)) => a == b,
            (Self::SetPlacement(_), Self::SetPlacement(_))
            | (Self::SetStep(_), Self::SetStep(_))
            | (Self::ReplaceAll(_), Self::ReplaceAll(_))
            | (Self::SetTransferFunction(_), Self::SetTransferFunction(_))
            | (Self::SetClip(_), Self::SetClip(_))
            | (Self::SetSurface(_), Self::SetSurface(_))
            | (Self::SetLook(_), Self::SetLook(_)) => true,
            _ => false,
        }
    }

    /// Does it.
    ///
    /// # Errors
    /// If there is no deformation with that index, or a transfer function is not sound; then nothing has changed.
    pub fn apply(&self, document: &mut Document) -> Result<(), EditError> {
        let count = document.stack.items.len();
        let items = &mut document.stack.items;
        let check = |index: usize| {
            if index < count { Ok(index) } else { Err(EditError::NoSuchDeformation { index, count }) }
        };
        match self {
            Self::SetVolume(v) => document.volume = v.clone(),
            Self::SetStep(step) => document.step = *step,
            Self::SetProxy(p) => document.proxy = p.clone(),
            Self::SetPlacement(p) => document.placement = *p,
            Self::Push(new) => items.extend_from_slice(new),
            Self::Replace(i, d) => items[check(*i)?] = d.clone(),
            Self::ReplaceAll(stack) => document.stack = stack.clone(),
            Self::Remove(i) => {
                items.remove(check(*i)?);
            }
            Self::Duplicate(i) => {
                let copy = items[check(*i)?].clone();
                items.insert(i + 1, copy);
            }
            Self::Move { from, to } => {
                check(*to)?;
                let item = items.remove(check(*from)?);
                items.insert(*to, item);
            }
            Self::Rename(i, name) => items[check(*i)?].name.clone_from(name),
            Self::Enable(i, on) => items[check(*i)?].enabled = *on,
            Self::SetAllowFolds(on) => document.allow_folds = *on,
            Self::SetTransfer(name) => {
                document.transfer.clone_from(name);
                document.transfer_function = None;
            }
            Self::SetTransferFunction(t) => {
                t.check()?;
                document.transfer_function = Some(t.clone());
            }
            Self::SetLook(look) => document.look = *look,
            Self::SetSurface(surface) => document.surface = surface.clone(),
            Self::SetClip(clip) => document.clip = *clip,
            Self::SetCamera(camera) => document.camera = *camera,
        }
        Ok(())
    }
}
