use std::sync::Arc;

use super::{Document, Edit, EditError};
use crate::deform::Deformer;

/// What a user did, by name.
#[derive(Debug, Clone)]
pub struct Step {
    pub name: String,
    /// The document after it.
    pub document: Arc<Document>,
}

/// A document with everything it was before: snapshots, as documents are small and volumes are not in them.
///
/// There is no limit to the number of steps but the budget: the oldest go when all together need more memory.
#[derive(Debug, Clone)]
pub struct History {
    steps: Vec<Step>,
    /// Index of the step that is shown.
    at: usize,
    /// Bytes.
    budget: usize,
    /// The last edit, as long as it may still be joined by the next.
    open: Option<Edit>,
    /// The step that is in the file, if it has been saved.
    saved: Option<Arc<Document>>,
    current: Arc<Document>,
    /// Whether the current document is another than the saved one but for the camera; asked for in every pass of a window.
    dirty: bool,
}

impl History {
    /// Bytes that are kept where nothing else is said.
    pub const BUDGET: usize = 64 << 20;

    /// A history that starts with a document as opened.
    pub fn new(document: Document, budget: usize) -> Self {
        let document = Arc::new(document);
        let first = Step { name: "Open".to_owned(), document: document.clone() };
        Self {
            steps: vec![first],
            at: 0,
            budget,
            open: None,
            saved: Some(document.clone()),
            current: document,
            dirty: false,
        }
    }

    pub fn document(&self) -> &Arc<Document> {
        &self.current
    }

    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Index of the step that is shown.
    pub fn at(&self) -> usize {
        self.at
    }

    /// Does an edit. Steps that were undone are gone then.
    ///
    /// # Errors
    /// As [`Edit::apply`].
    pub fn apply(&mut self, edit: Edit) -> Result<(), EditError> {
        let mut document = (*self.current).clone();
        edit.apply(&mut document)?;
        if document == *self.current {
            return Ok(());
        }
        let name = edit.name(&self.current);
        self.current = Arc::new(document);
        if !edit.is_step() {
            return Ok(());
        }
        self.judge();
        let joins = self.open.as_ref().is_some_and(|before| edit.joins(before)) && self.at + 1 == self.steps.len();
        self.steps.truncate(self.at + 1);
        if joins && self.at > 0 {
            self.steps[self.at].document = self.current.clone();
        } else {
            self.steps.push(Step { name, document: self.current.clone() });
            self.at += 1;
        }
        self.open = Some(edit);
        self.keep_within_budget();
        Ok(())
    }

    /// The next edit is a step of its own, whatever it is: the hand has left the slider.
    pub fn close_step(&mut self) {
        self.open = None;
    }

    /// Goes back one step; the camera stays. False if there is none.
    pub fn undo(&mut self) -> bool {
        self.at > 0 && self.go(self.at - 1)
    }

    /// Goes forward one step. False if there is none.
    pub fn redo(&mut self) -> bool {
        self.go(self.at + 1)
    }

    /// Goes to any step. False if there is no such.
    pub fn go(&mut self, step: usize) -> bool {
        let Some(target) = self.steps.get(step) else { return false };
        let camera = self.current.camera;
        self.current = if target.document.camera == camera {
            target.document.clone()
        } else {
            Arc::new(Document { camera, ..(*target.document).clone() })
        };
        self.at = step;
        self.open = None;
        self.judge();
        true
    }

    /// The document as it is now is in the file.
    pub fn mark_saved(&mut self) {
        self.saved = Some(self.current.clone());
        self.judge();
    }

    /// The document is in no file as it is now, whatever was opened.
    pub fn mark_unsaved(&mut self) {
        self.saved = None;
        self.judge();
    }

    /// Whether something would be lost without saving. Looking from elsewhere does not count.
    pub fn is_dirty(&self) -> bool {
        self.dirty
    }

    fn judge(&mut self) {
        self.dirty = self.saved.as_ref().is_none_or(|saved| {
            !Arc::ptr_eq(saved, &self.current)
                && Document { camera: self.current.camera, ..(**saved).clone() } != *self.current
        });
    }

    /// About how many bytes all steps need.
    pub fn bytes(&self) -> usize {
        self.steps.iter().map(|s| bytes(&s.document)).sum()
    }

    fn keep_within_budget(&mut self) {
        let mut sum = self.bytes();
        let mut gone = 0;
        // what is shown and one step back always stay
        while sum > self.budget && gone + 1 < self.at {
            sum -= bytes(&self.steps[gone].document);
            gone += 1;
        }
        self.steps.drain(..gone);
        self.at -= gone;
    }
}

fn bytes(document: &Document) -> usize {
    let handles = |d: &Deformer| match d {
        Deformer::Lattice(l) => size_of_val(l.handles()),
        _ => 0,
    };
    let items = document.stack.items.iter().map(|i| size_of_val(i) + i.name.len() + handles(&i.deformer));
    size_of_val(document) + items.sum::<usize>()
}
