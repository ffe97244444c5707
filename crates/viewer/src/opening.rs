//! Opening another scene, and going back to the one before: no changes are lost by it.

use crate::size::fits;
use crate::state::{Change, State};
use crate::{Opened, Which};
use snell_render::Settings;
use std::sync::Arc;
use std::time::Instant;

/// Maximum number of scenes that are kept with their changes; the oldest are forgotten.
const MOST: usize = 4;

/// Scenes that were left for another one, each as it was then.
#[derive(Clone, Default)]
pub struct Others {
    before: Vec<Arc<State>>,
    after: Vec<Arc<State>>,
}

impl Others {
    /// Forgets the scenes that could be returned to by redoing.
    pub fn forget_later(&mut self) {
        self.after.clear();
    }
}

impl State {
    /// Whether there is a step to undo, and one to redo: a change, a move of the camera, or the
    /// opening of another scene.
    pub fn can(&self) -> [bool; 2] {
        let [undo, redo] = self.history.can();
        [undo || !self.others.before.is_empty(), redo || !self.others.after.is_empty()]
    }

    /// The state for another scene on the same pages, or for the same scene read again (`is_same`);
    /// then camera and settings stay. A scene with changes is kept: undoing brings it back.
    pub fn reopened(
        &self,
        opened: Opened,
        origin: Result<Which, String>,
        is_same: bool,
    ) -> Result<Self, String> {
        let mut new = Self::with_size(opened, self.settings.size)?;
        (new.generation, new.geometry, new.seq) =
            (self.generation + 1, self.geometry + 1, self.seq);
        new.camera_changes = self.camera_changes + 1;
        new.pictures = self.pictures.clone();
        new.origin = origin;
        new.others.before = self.others.before.clone();
        if self.is_changed() {
            new.others.before.push(self.alone());
            let many = new.others.before.len().saturating_sub(MOST);
            new.others.before.drain(..many);
        }
        if is_same {
            (new.camera, new.display) = (self.camera.clone(), self.display);
            new.standpoint = self.standpoint;
            new.camera_changes = self.camera_changes;
            new.settings = Settings { build: new.settings.build.clone(), ..self.settings.clone() };
            new.request = self.request.clone();
        }
        Ok(new)
    }

    /// True if the scene is not as it was opened.
    pub fn is_changed(&self) -> bool {
        !self.history.standing().is_empty()
    }

    /// Goes back to the scene before this one, as it was left.
    pub(crate) fn undo_opening(&mut self) -> Result<Change, String> {
        let mut others = self.others.clone();
        let Some(scene) = others.before.pop() else { return Ok(Change::Nothing) };
        others.after.push(self.alone());
        self.become_scene(&scene, others)
    }

    /// Goes to the scene that was left by going back.
    pub(crate) fn redo_opening(&mut self) -> Result<Change, String> {
        let mut others = self.others.clone();
        let Some(scene) = others.after.pop() else { return Ok(Change::Nothing) };
        others.before.push(self.alone());
        self.become_scene(&scene, others)
    }

    /// This state without the other scenes.
    fn alone(&self) -> Arc<Self> {
        Arc::new(Self { others: Others::default(), ..self.clone() })
    }

    fn become_scene(&mut self, scene: &Self, others: Others) -> Result<Change, String> {
        // The page may have another size now.
        let size = self.settings.size;
        *self = Self { others, ..self.taken_back_to(scene) };
        if size != self.settings.size {
            fits(&Settings { size, ..self.settings.clone() })?;
            self.resize(size);
        }
        Ok(Change::Picture)
    }

    /// Returns the earlier state `before`, after this one could not be rendered, or was left. The
    /// counters of the result continue from this state's.
    pub fn taken_back_to(&self, before: &Self) -> Self {
        Self {
            generation: self.generation + 1,
            geometry: self.geometry + 1,
            placement: self.placement + 1,
            camera_changes: self.camera_changes + 1,
            seq: self.seq,
            moved: Instant::now(),
            ..before.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PlainWriter;
    use crate::protocol::ToServer;
    use snell_formats::image::Display;
    use snell_render::Request;
    use snell_scene::builtin::builtin;

    fn opened(name: &str) -> Opened {
        let scene = builtin(name).expect("the scene is built in");
        Opened {
            camera: scene.cameras[0].clone(),
            scene,
            camera_number: 0,
            camera_for_size: None,
            is_encoding_given: false,
            writer: Arc::new(PlainWriter),
            request: Request::default(),
            settings: Settings { size: [8, 6], spp: 1, ..Settings::default() },
            display: Display::default(),
            animate: None,
            command: Vec::new(),
        }
    }

    fn after(state: &State, message: ToServer) -> State {
        state.after(message).expect("it is possible").0
    }

    fn edit(state: &State, text: &str) -> State {
        after(state, ToServer::Edit { key: "ambient".into(), value: text.into() })
    }

    fn to(state: &State, name: &str) -> State {
        let origin = Ok(Which::Builtin(name.into()));
        state.reopened(opened(name), origin, false).expect("it fits")
    }

    #[test]
    fn undoing_after_another_scene_was_opened_brings_the_changes_back() {
        let first = State::new(opened("cornell-box")).expect("it fits");
        // A scene without changes is not kept.
        assert_eq!(to(&first, "spheres").can(), [false, false]);
        let ambient = serde_json::json!([1, 2, 3]);
        let changed = after(&first, ToServer::Edit { key: "ambient".into(), value: ambient });
        let second = after(&to(&changed, "spheres"), ToServer::Size { size: [9, 7] });
        assert_eq!((second.can(), &*second.scene.name), ([true, false], "spheres"));
        let back = after(&second, ToServer::Undo);
        assert_eq!((back.can(), &*back.scene.name), ([true, true], "cornell-box"));
        assert_eq!((back.scene.ambient.b, back.settings.size), (3.0, [9, 7]));
        assert!(matches!(back.origin, Ok(Which::Given)));
        assert!(back.generation > second.generation && back.geometry > second.geometry);
        let again = after(&back, ToServer::Redo);
        assert_eq!((again.can(), &*again.scene.name), ([true, false], "spheres"));
        // The changes of a scene that was returned to can be undone too; new ones end redoing.
        let bare = after(&after(&again, ToServer::Undo), ToServer::Undo);
        assert_eq!((bare.can(), bare.is_changed()), ([false, true], false));
        assert_eq!(edit(&bare, "[1,1,1]").can(), [true, false]);
    }

    #[test]
    fn a_scene_that_is_read_again_leaves_its_changes_to_undo_and_few_are_kept() {
        let mut state = State::new(opened("cornell-box")).expect("it fits");
        for number in 1..7 {
            state = edit(&state, &format!("[{number},1,1]"));
            let again = state.reopened(opened("cornell-box"), state.origin.clone(), true);
            state = again.expect("it fits");
            assert!(!state.is_changed());
        }
        let mut steps = 0;
        while state.can()[0] {
            state = after(&state, ToServer::Undo);
            steps += 1;
        }
        // Each scene, and its own change.
        assert_eq!(steps, 2 * MOST);
    }
}
