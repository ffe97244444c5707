//! Transforms that change over time.

use super::*;
use snell_math::DVec3;
use snell_scene::Player;

#[test]
fn shapes_instances_and_the_camera_move_between_their_two_places() {
    let scene = scene(
        r#"ActiveTransform EndTime LookAt 0 0 9  0 0 8  0 1 0  ActiveTransform StartTime LookAt 0 0 7  0 0 6  0 1 0
        ActiveTransform All
        Camera "perspective" "float shutteropen" 0.25 "float shutterclose" 0.75
        WorldBegin
        Shape "sphere"
        AttributeBegin ActiveTransform EndTime Translate 4 0 0 ActiveTransform All Shape "sphere" AttributeEnd
        ObjectBegin "ball" Shape "sphere" ObjectEnd
        TransformBegin TransformTimes 0 1 ActiveTransform EndTime Rotate 90 0 1 0 ObjectInstance "ball" TransformEnd"#,
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.settings.shutter, Some([0.25, 0.75]));
    let motion = scene.motion.clone().expect("it moves");
    assert_eq!(motion.joints.len(), 3, "two things and the camera");
    let mut player = Player::new(motion.clone(), motion.usual_clips());
    assert_eq!(player.span(), [0.0, 1.0]);
    let mut posed = scene.clone();
    posed.apply(&player.pose(0.5));
    let ball = motion.joints[0].node.expect("it moves a node");
    assert_eq!(posed.nodes[ball.index()].transform.translation, DVec3::new(2.0, 0.0, 0.0));
    assert!((posed.cameras[0].eye.z.abs() - 8.0).abs() < 1e-9, "{}", posed.cameras[0].eye);
    let still = scene.nodes.iter().filter(|n| !n.surfaces.is_empty()).count();
    assert_eq!(still, 3, "what moves has a node of its own");
}

#[test]
fn files_in_which_nothing_moves_have_no_motion_and_no_shutter() {
    let scene = world(r#"Translate 1 2 3 Shape "sphere""#);
    assert!(scene.motion.is_none() && scene.settings.shutter.is_none());
}
