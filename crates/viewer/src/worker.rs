//! The render thread: small pictures while something moves, the picture of `snell render` at rest.

use crate::budget::Budget;
use crate::encode::{Encoder, Picture};
use crate::preview::{self, Preview, rgb_of};
use crate::protocol::{FrameHeader, ToPage};
use crate::session::{Finished, REST, Session, Snapshot, lock};
use crate::size::fits;
use crate::temporal::{self, History};
use snell_math::Rgb;
use snell_render::{CompiledScene, Film, IntegratorKind, Job, Settings, Underway, picture};
use snell_scene::Scene;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples per pixel of the quick picture that is shown during path-guiding training.
const QUICK: u32 = 16;

/// Minimum interval between pictures at rest.
const REST_INTERVAL: Duration = Duration::from_millis(100);

/// Maximum number of moving pictures that are not shown yet when the next one is begun: one in
/// transit and one being encoded.
const UNSEEN: u32 = 2;
/// Maximum time that the next moving picture waits for a slower page.
const PATIENCE: Duration = Duration::from_millis(100);

/// Renders for a session until it ends.
pub struct Worker<'a> {
    session: &'a Session,
    threads: usize,
    budget: Budget,
    compiled: Option<Compiled>,
    encoder: Encoder,
    frame: u32,
    /// The number of the last picture, if it showed something moving.
    moving: Option<u32>,
    /// The constant for indirect light while something moves; `None` for a new scene.
    fill: Option<Rgb>,
    /// The last moving picture, and the version that it shows.
    last_preview: Option<(u64, Vec<f32>)>,
    /// The last moving picture, which the next one can reuse if the scene's generation and the
    /// integrator are the same.
    history: Option<((u32, IntegratorKind), History)>,
    /// The picture at rest that is being made.
    refinement: Option<Refinement>,
}

/// A compiled scene.
struct Compiled {
    generation: u32,
    geometry: u32,
    scene: Arc<Scene>,
    compiled: Arc<CompiledScene>,
}

struct Refinement {
    version: u64,
    underway: Underway,
    /// True for the quick picture that is shown during training.
    is_quick: bool,
    spent: Duration,
    sent: Option<Instant>,
    is_complete: bool,
}

impl<'a> Worker<'a> {
    /// Renders for a session until it ends, with this number of threads and of frames per second.
    pub fn run(session: &'a Session, threads: usize, frames_per_second: f64) {
        std::thread::scope(|scope| {
            Self::new(session, threads, frames_per_second, Encoder::new(scope, session)).work();
        });
    }

    fn new(session: &'a Session, threads: usize, frames_per_second: f64, encoder: Encoder) -> Self {
        Self {
            session,
            threads,
            budget: Budget::new(frames_per_second),
            compiled: None,
            encoder,
            frame: 0,
            moving: None,
            fill: None,
            last_preview: None,
            history: None,
            refinement: None,
        }
    }

    /// Renders until the session ends. A panic in a picture is reported to the pages, and the next
    /// change is rendered again.
    fn work(mut self) {
        // No page is open yet; compiling now saves the first page the wait. A failure here repeats,
        // and is reported, when a page is open.
        let _ = catch_unwind(AssertUnwindSafe(|| self.compile(&self.session.now())));
        let mut seen = 0;
        let mut due = None;
        while let Some(snapshot) = self.next(seen, due) {
            let is_new = snapshot.version != seen;
            seen = snapshot.version;
            let outcome = catch_unwind(AssertUnwindSafe(|| self.step(&snapshot, is_new)));
            due = match outcome {
                Ok(Ok(due)) => due,
                Ok(Err(message)) => {
                    self.session.has_failed(snapshot.version, message);
                    None
                }
                Err(_) => {
                    self.forget();
                    let message =
                        "a fault in the renderer; the scene can still be changed or reloaded"
                            .into();
                    self.session.has_failed(snapshot.version, message);
                    None
                }
            };
        }
    }

    /// Discards everything that a panic may have left half done.
    fn forget(&mut self) {
        (self.compiled, self.refinement, self.history) = (None, None, None);
        (self.fill, self.last_preview, self.moving) = (None, None, None);
    }

    /// The next state to render. Waits until it is due, and until a page has shown an earlier
    /// picture.
    fn next(&self, seen: u64, due: Option<Instant>) -> Option<Snapshot> {
        if let Some(last) = self.moving {
            self.session.pace.wait_for(last.wrapping_sub(UNSEEN), PATIENCE);
        }
        self.session.wait(seen, due)
    }

    /// Renders one frame while moving, or one step of refinement. Returns the time of the next step
    /// if nothing changes.
    fn step(&mut self, snapshot: &Snapshot, is_new: bool) -> Result<Option<Instant>, String> {
        let compiled = self.compile(snapshot)?;
        if is_new {
            self.refinement = None;
            self.preview(snapshot, &compiled)?;
            self.moving = Some(self.frame);
            self.session.has_shown(snapshot.version);
            return Ok(Some(snapshot.moved + REST));
        }
        self.moving = None;
        Ok(self.refine(snapshot, &compiled)?.then(Instant::now))
    }

    fn compile(&mut self, snapshot: &Snapshot) -> Result<Arc<CompiledScene>, String> {
        let Snapshot { generation, geometry, ref scene, ref settings, .. } = *snapshot;
        if let Some(known) = self.compiled.as_ref().filter(|known| known.generation == generation) {
            return Ok(known.compiled.clone());
        }
        let before = self.compiled.take();
        let changed = match before.filter(|known| known.geometry == geometry) {
            Some(known) => {
                known.compiled.changed(&known.scene, scene).map_err(|e| e.to_string())?
            }
            None => None,
        };
        let compiled = match changed {
            Some(compiled) => compiled,
            None => {
                self.budget.reset();
                self.fill = None;
                CompiledScene::new(scene, &settings.build).map_err(|e| e.to_string())?
            }
        };
        let compiled = Arc::new(compiled);
        self.compiled = Some(Compiled {
            generation,
            geometry,
            scene: scene.clone(),
            compiled: compiled.clone(),
        });
        self.session.set_compiled(generation, &compiled);
        Ok(compiled)
    }

    fn preview(
        &mut self,
        snapshot: &Snapshot,
        compiled: &Arc<CompiledScene>,
    ) -> Result<(), String> {
        let start = Instant::now();
        let size = self.budget.size(snapshot.settings.size);
        // One thread is left for encoding and showing the previous picture, which would otherwise
        // delay the next one.
        let threads = (self.threads - 1).max(1);
        let guess = || preview::first_fill(&snapshot.settings, &snapshot.camera, compiled, threads);
        let fill = *self.fill.get_or_insert_with(guess);
        let mut preview = Preview::new(&snapshot.settings, compiled, size, fill);
        let history = self.history.take();
        let (shown, rgb) = if preview.has_fill && size != snapshot.settings.size {
            let what = (snapshot.generation, snapshot.settings.integrator);
            let before = history.filter(|(of, _)| *of == what);
            preview = preview.at_phase(temporal::phase(self.frame));
            let before = before.as_ref().map(|(_, history)| history);
            let next = preview
                .follow(before, &snapshot.camera, compiled, threads)
                .ok_or("a fault in the renderer")?;
            let shown = (next.size(), next.rgb().to_vec());
            self.history = Some((what, next));
            shown
        } else {
            (size, preview.render(&snapshot.camera, compiled, threads))
        };
        let has_fill = preview.has_fill && snapshot.settings.integrator == IntegratorKind::Path;
        self.last_preview = has_fill.then(|| (snapshot.version, rgb.clone()));
        let header = self.header(snapshot, shown, start.elapsed());
        self.encoder.send(Picture { header, rgb, display: Some(snapshot.display) })?;
        // The time includes the wait for the encoder, if that is the bottleneck.
        self.budget.spent(size, start.elapsed().as_secs_f64());
        Ok(())
    }

    /// Renders one step of the picture at rest; true if there is more to do.
    fn refine(
        &mut self,
        snapshot: &Snapshot,
        compiled: &Arc<CompiledScene>,
    ) -> Result<bool, String> {
        let (settings, version) = (&snapshot.settings, snapshot.version);
        let (threads, keep_going) = (self.threads, |_: &_| self.session.version() == version);
        let unguided = Settings { guiding: None, noise: None, ..settings.clone() };
        let quick = Job::new(compiled, &snapshot.camera, &unguided);
        let whole = Job::new(compiled, &snapshot.camera, settings);
        let start = Instant::now();
        let mut refinement = match self.refinement.take().filter(|r| r.version == version) {
            Some(known)
                if known.is_quick && known.underway.samples() >= QUICK.min(settings.spp) =>
            {
                self.session
                    .tell(ToPage::Busy { message: "learning where light comes from".into() });
                let underway = whole.begin(threads, &keep_going);
                self.session.tell(ToPage::Busy { message: String::new() });
                Refinement { underway, is_quick: false, ..known }
            }
            Some(known) => known,
            None => {
                // Memory may have become scarce since the size was accepted.
                fits(settings)?;
                self.session.tell_view();
                let is_quick = settings.guiding.is_some();
                let underway = if is_quick { &quick } else { &whole }.begin(threads, &keep_going);
                Refinement {
                    version,
                    underway,
                    is_quick,
                    spent: Duration::ZERO,
                    sent: None,
                    is_complete: false,
                }
            }
        };
        if refinement.is_complete {
            self.refinement = Some(refinement);
            return Ok(false);
        }
        let job = if refinement.is_quick { &quick } else { &whole };
        let until = next_pass(refinement.underway.samples());
        let has_more =
            job.go_on(&mut refinement.underway, until, threads, &keep_going) || refinement.is_quick;
        refinement.spent += start.elapsed();
        if self.session.version() != version {
            return Ok(false);
        }
        refinement.is_complete = !has_more;
        // Until the new picture has as many samples, the quick one is better.
        let is_worse = settings.guiding.is_some()
            && !refinement.is_quick
            && refinement.underway.samples() < QUICK;
        let is_due =
            !is_worse && refinement.sent.is_none_or(|sent| sent.elapsed() >= REST_INTERVAL);
        if !has_more || is_due {
            self.publish(snapshot, compiled, &refinement)?;
            refinement.sent = Some(Instant::now());
        }
        self.refinement = Some(refinement);
        Ok(has_more)
    }

    /// Shows the current picture at rest.
    fn publish(
        &mut self,
        snapshot: &Snapshot,
        compiled: &CompiledScene,
        refinement: &Refinement,
    ) -> Result<(), String> {
        let Refinement { version, underway: Underway { film, .. }, is_complete, spent, .. } =
            refinement;
        let settings = &snapshot.settings;
        let samples = film.mean_samples() as u32;
        let image = picture(film, settings, compiled);
        let rgb = rgb_of(&image);
        if let Some((_, preview)) =
            self.last_preview.take_if(|(of, _)| of == version && samples >= 4)
        {
            self.fill = Some(preview::fill(&rgb, &preview, self.fill.unwrap_or(Rgb::BLACK)));
        }
        let header = FrameHeader {
            kind: 1,
            samples,
            wanted: if *is_complete { samples } else { settings.spp.max(samples + 1) },
            noise: if samples >= 4 { noise_of(film, &rgb) } else { f32::NAN },
            ..self.header(snapshot, settings.size, *spent)
        };
        self.encoder.send(Picture { header, rgb, display: None })?;
        let (name, picture) = (snapshot.scene.name.clone(), Arc::new(image));
        *lock(&self.session.finished) = Some(Finished { name, picture });
        Ok(())
    }

    fn header(&mut self, snapshot: &Snapshot, size: [u32; 2], spent: Duration) -> FrameHeader {
        self.frame = self.frame.wrapping_add(1);
        FrameHeader {
            kind: 0,
            frame: self.frame,
            seq: snapshot.seq,
            generation: snapshot.generation,
            size,
            samples: 1,
            wanted: 0,
            milliseconds: spent.as_secs_f32() * 1000.0,
            noise: f32::NAN,
        }
    }
}

/// Samples per pixel after the next step.
fn next_pass(samples: u32) -> u32 {
    match samples {
        0 => 1,
        1..4 => 4,
        _ => (samples / 16 + 1) * 16,
    }
}

/// The square root of the mean variance over the mean of the values, which are linear RGB.
fn noise_of(film: &Film, rgb: &[f32]) -> f32 {
    let variance = &film.variance().layers[0].values;
    let sum: f64 = variance.chunks_exact(4).map(|p| f64::from(p[0] + p[1] + p[2])).sum();
    let mean = |sum: f64| sum / rgb.len().max(1) as f64;
    let light = mean(rgb.iter().map(|&x| f64::from(x)).sum());
    (mean(sum).max(0.0).sqrt() / light.max(1e-30)) as f32
}
