//! Files of renders on their way, whose checksums are always right.

use snell_render::{Aov, CompiledScene, Job, Settings};
use snell_scene::Scene;
use std::sync::LazyLock;

/// A file with a mark and these contents: of each chunk two bytes with its length, least first, and
/// that many bytes, the last as many as are left.
pub fn file(mark: &[u8; 8], mut contents: &[u8]) -> Vec<u8> {
    let mut file = mark.to_vec();
    while let [low, high, rest @ ..] = contents {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
        let (content, next) = rest.split_at(length);
        let packed = lz4_flex::block::compress(content);
        let head = [content.len() as u32, packed.len() as u32, crc32fast::hash(&packed)];
        file.extend(head.into_iter().flat_map(u32::to_le_bytes));
        file.extend(packed);
        contents = next;
    }
    file
}

/// Does something with a small render whose pixels stop by their error.
pub fn with_job(act: impl FnOnce(&Job)) {
    static SCENE: LazyLock<(Scene, CompiledScene, Settings)> = LazyLock::new(|| {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let settings = Settings {
            size: [20, 18],
            spp: 300,
            noise: Some(0.2),
            max_depth: 1,
            aovs: vec![Aov::Depth, Aov::CryptoObject],
            ..Settings::default()
        };
        let compiled = CompiledScene::new(&scene, &settings.build).expect("a valid scene");
        (scene, compiled, settings)
    });
    let (scene, compiled, settings) = &*SCENE;
    act(&Job::new(compiled, &scene.cameras[0], settings));
}
