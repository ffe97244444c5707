//! What can be undone: changes of the scene and moves of the camera, in one list.

use crate::edits::Edits;
use snell_scene::Camera;
use std::sync::Arc;

/// Maximum number of moves of the camera that are kept; the oldest are forgotten.
const MAX_MOVES: usize = 200;

/// A step that can be undone.
#[derive(Clone, Debug)]
enum Step {
    /// The next of the changes of the scene.
    Edit,
    /// A move of the camera.
    Move(Arc<Move>),
}

/// A move of the camera: one gesture of the user, such as a drag.
#[derive(Clone, Debug)]
struct Move {
    /// Number of the gesture.
    gesture: u32,
    before: Camera,
    after: Camera,
}

/// What an undone or redone step requires.
#[derive(Clone, Debug, PartialEq)]
pub enum Restored {
    /// The scene is to be made from the changes that are in force now.
    Scene,
    /// The camera is this one.
    Camera(Box<Camera>),
}

/// The steps so far. Looking around never loses a change of the scene that can be redone.
#[derive(Clone, Debug, Default)]
pub struct History {
    edits: Edits,
    steps: Vec<Step>,
    /// Number of steps that are in force; the rest can be redone.
    applied: usize,
}

impl History {
    /// Whether there is a step to undo, and one to redo.
    pub fn can(&self) -> [bool; 2] {
        [self.applied > 0, self.applied < self.steps.len()]
    }

    /// Adds a change of the scene, see [`Edits::push`], after which nothing can be redone.
    pub fn edit(&mut self, definitions: Vec<String>, gesture: Option<u32>) -> Result<(), String> {
        let before = self.edits.count();
        self.edits.push(definitions, gesture)?;
        self.steps.truncate(self.applied);
        if self.edits.count() > before {
            self.steps.push(Step::Edit);
        }
        self.applied = self.steps.len();
        Ok(())
    }

    /// The changes of the scene that are in force, see [`Edits::standing`].
    pub fn standing(&self) -> Vec<&str> {
        self.edits.standing()
    }

    /// Adds a move of the camera, or goes on with the last one if it is the same gesture. Changes
    /// of the scene can still be redone, other moves cannot.
    pub fn moved(&mut self, gesture: u32, before: &Camera, after: &Camera) {
        let last = self.applied.checked_sub(1).map(|last| &mut self.steps[last]);
        if let Some(Step::Move(known)) = last.as_deref()
            && known.gesture == gesture
        {
            let next = Move { after: after.clone(), ..(**known).clone() };
            *last.expect("it was there") = Step::Move(Arc::new(next));
            return;
        }
        if before == after {
            return;
        }
        let undone = self.steps.split_off(self.applied);
        let step = Move { gesture, before: before.clone(), after: after.clone() };
        self.steps.push(Step::Move(Arc::new(step)));
        let is_move = |step: &Step| matches!(step, Step::Move(_));
        if self.steps.iter().filter(|step| is_move(step)).count() > MAX_MOVES {
            let oldest = self.steps.iter().position(is_move).expect("there are many");
            self.steps.remove(oldest);
        }
        self.applied = self.steps.len();
        self.steps.extend(undone.into_iter().filter(|step| !is_move(step)));
    }

    /// Takes the last step back.
    pub fn undo(&mut self) -> Option<Restored> {
        self.applied = self.applied.checked_sub(1)?;
        Some(match &self.steps[self.applied] {
            Step::Edit => {
                self.edits.undo();
                Restored::Scene
            }
            Step::Move(step) => Restored::Camera(Box::new(step.before.clone())),
        })
    }

    /// Does the last undone step again.
    pub fn redo(&mut self) -> Option<Restored> {
        let step = self.steps.get(self.applied)?;
        self.applied += 1;
        Some(match step {
            Step::Edit => {
                self.edits.redo();
                Restored::Scene
            }
            Step::Move(step) => Restored::Camera(Box::new(step.after.clone())),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    fn camera(x: f32) -> Camera {
        Camera::look_at(Vec3::new(x, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.5)
    }

    fn edited() -> History {
        let mut history = History::default();
        history.edit(vec!["a=1".into()], None).expect("it is one");
        history
    }

    #[test]
    fn a_slider_that_is_dragged_is_one_step() {
        let mut history = edited();
        history.edit(vec!["a=2".into()], None).expect("they are few");
        history.edit(vec!["b=1".into()], None).expect("they are few");
        assert_eq!(
            (history.undo(), history.undo()),
            (Some(Restored::Scene), Some(Restored::Scene))
        );
        assert_eq!(history.can(), [false, true]);
    }

    #[test]
    fn a_gesture_is_one_step_among_the_changes() {
        let mut history = edited();
        for x in 1..=3 {
            history.moved(7, &camera(x as f32 - 1.0), &camera(x as f32));
        }
        history.moved(8, &camera(3.0), &camera(4.0));
        assert_eq!(history.undo(), Some(Restored::Camera(Box::new(camera(3.0)))));
        assert_eq!(history.undo(), Some(Restored::Camera(Box::new(camera(0.0)))));
        assert_eq!(history.redo(), Some(Restored::Camera(Box::new(camera(3.0)))));
        assert_eq!(history.undo(), Some(Restored::Camera(Box::new(camera(0.0)))));
        assert_eq!(history.undo(), Some(Restored::Scene));
        assert_eq!((history.undo(), history.can()), (None, [false, true]));
    }

    #[test]
    fn looking_around_after_an_undo_loses_no_change_of_the_scene() {
        let mut history = edited();
        history.undo();
        history.moved(1, &camera(0.0), &camera(1.0));
        assert!(history.standing().is_empty());
        assert_eq!(history.redo(), Some(Restored::Scene));
        assert_eq!(history.standing(), ["a=1"]);
    }

    #[test]
    fn the_oldest_moves_are_forgotten_and_changes_are_kept() {
        let mut history = edited();
        for i in 0..1000 {
            history.moved(i, &camera(i as f32), &camera(i as f32 + 1.0));
        }
        assert_eq!((history.steps.len(), history.standing().len()), (1 + MAX_MOVES, 1));
    }
}
