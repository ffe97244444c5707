//! The renderer: it compiles a scene, samples it, transports light, and collects it on the film.
//!
//! The modules are listed in the order of the data flow. This crate does no I/O: it takes a
//! [`snell_scene::Scene`] and returns pictures in memory.
//!
//! ```
//! use snell_render::{CompiledScene, Job, Settings};
//! use snell_scene::{Scene, Camera};
//! use snell_math::Vec3;
//!
//! let mut scene = Scene::new("empty");
//! scene.environment = Some(snell_scene::Environment::Constant(snell_math::Rgb::splat(0.5)));
//! let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 0.5);
//! let settings = Settings { size: [8, 8], spp: 4, ..Settings::default() };
//! let compiled = CompiledScene::new(&scene, &settings.build).unwrap();
//! let (film, _statistics) = Job::new(&compiled, &camera, &settings).run(1, &|_| true);
//! assert_eq!(film.image().layers[0].values[0], 0.5);
//! ```

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]
#![forbid(unsafe_code)]

mod batch;
pub mod compile;
pub mod explain;
pub mod film;
pub mod guiding;
pub mod integrator;
pub mod irradiance;
pub mod job;
mod lanes;
pub mod layers;
pub mod light_sampler;
pub mod memory;
mod named;
mod picture;
pub mod reference;
pub mod request;
#[cfg(test)]
mod rooms;
pub mod sampler;
pub mod settings;
pub mod threads;
mod volume;

pub use compile::{CompileError, CompiledScene, Moving};
pub use film::{Film, FilmTile, filter::Filter};
pub use guiding::Guiding;
pub use integrator::{IntegratorKind, albedos::Albedos, aov::Aov};
pub use job::{
    Difference, FRAME, Fact, Header, Job, MARK_BYTES, Origin, PhotonCounts, Progress, Pulse,
    Recording, SavedError, Split, Statistics, Task, TaskInput, TaskResult, Training, Underway,
    fact, facts, may_be_checkpoint, with_patience,
};
pub use light_sampler::LightSamplerKind;
pub use picture::picture;
pub use request::{
    Denoise, Form, GuidingPasses, Heading, Problem, Request, RequestError, Setting, Wish,
    seconds_of,
};
pub use sampler::SamplerKind;
pub use settings::{
    CausticsMode, Crop, LightGroup, LightStrategy, Settings, Shadows, Terminator, TileOrder,
};
