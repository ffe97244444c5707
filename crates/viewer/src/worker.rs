//! The render thread: small pictures while something moves, the picture of `snell render` at rest.

use crate::Finished;
use crate::budget::Budget;
use crate::encode::{Encoder, Picture};
use crate::learned::{Learned, Raw};
use crate::light::Lit;
use crate::preview::{Moving, View, rgb_of};
use crate::protocol::{FrameHeader, ToPage};
use crate::rest::{Resting, denoised_share, is_denoised};
use crate::session::{REST, Session, Snapshot, lock};
use crate::size::fits;
use crate::surfaces::Color;
use snell_persist::{Checkpoint, Resume, Saved, Wording};
use snell_render::{CompiledScene, Film, Job, Progress, Settings, Underway, picture};
use snell_scene::Scene;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples per pixel of the quick picture that is shown during path-guiding training.
const QUICK: u32 = 16;

/// Time that a step of refinement takes, about.
const STEP: Duration = Duration::from_millis(500);
/// Minimum interval between pictures at rest.
const REST_INTERVAL: Duration = Duration::from_millis(100);
/// The interval is also at least this multiple of the time that it took to make the last of them
/// ready to be shown.
const REST_SHARE: u32 = 4;

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
    encoder: Encoder<'a>,
    learned: Learned,
    /// The version that was rendered last.
    seen: u64,
    /// When the next step of the same version is due.
    due: Option<Instant>,
    /// Maximum time of a step of refinement; `None` on a thread of its own, which notices changes
    /// meanwhile.
    slice: Option<Duration>,
    frame: u32,
    /// The number of the last picture, if it showed something moving, and when it was begun.
    last_moving: Option<(u32, Instant)>,
    /// The moving pictures so far.
    moving: Moving,
    /// The picture at rest that is being made.
    refinement: Option<Refinement>,
}

/// A compiled scene.
struct Compiled {
    generation: u32,
    geometry: u32,
    placement: u32,
    scene: Arc<Scene>,
    compiled: Arc<CompiledScene>,
}

/// The samples from which Open Image Denoise begins; after that, it begins anew for so many times
/// the samples.
const LEARNED: f32 = 4.0;

struct Refinement {
    version: u64,
    settings: Settings,
    underway: Underway,
    /// The file that keeps the picture; `None` if none is kept.
    checkpoint: Option<Checkpoint>,
    /// True for the quick picture that is shown during training.
    is_quick: bool,
    /// The samples per pixel at the end of the present pass.
    until: u32,
    spent: Duration,
    /// When the next picture is due.
    due: Option<Instant>,
    is_complete: bool,
    /// What the denoised picture needs, if light is transported.
    resting: Option<Resting>,
}

impl<'a> Worker<'a> {
    /// A worker without threads, which renders in [`Self::turn`].
    pub fn alone(session: &'a Session, frames_per_second: f64) -> Self {
        let encoder = Encoder::here(session);
        Self::new(session, 1, frames_per_second, encoder, Learned::none())
    }

    /// Does what is due, for about as long as `slice`; returns how long nothing will be, `None` if
    /// that is until the next message.
    pub fn turn(&mut self, slice: Duration) -> Option<Duration> {
        self.slice = Some(slice);
        if let Some((last, begun)) = self.last_moving
            && !self.session.pace.has_shown(last.wrapping_sub(UNSEEN))
            && begun.elapsed() < PATIENCE
        {
            return Some(PATIENCE - begun.elapsed());
        }
        if let Some(snapshot) = self.session.due(self.seen, self.due) {
            self.serve(&snapshot);
        }
        if self.session.version() != self.seen {
            return Some(Duration::ZERO);
        }
        self.due.map(|due| due.saturating_duration_since(Instant::now()))
    }

    fn new(
        session: &'a Session,
        threads: usize,
        frames_per_second: f64,
        encoder: Encoder<'a>,
        learned: Learned,
    ) -> Self {
        Self {
            session,
            threads,
            budget: Budget::new(frames_per_second),
            compiled: None,
            encoder,
            learned,
            seen: 0,
            due: None,
            slice: None,
            frame: 0,
            last_moving: None,
            moving: Moving::default(),
            refinement: None,
        }
    }

    /// Renders one step of a state, and notes when the next one is due.
    fn serve(&mut self, snapshot: &Snapshot) {
        let is_new = snapshot.version != self.seen;
        self.seen = snapshot.version;
        let outcome = catch_unwind(AssertUnwindSafe(|| self.step(snapshot, is_new)));
        self.due = match outcome {
            Ok(Ok(due)) => due,
            Ok(Err(message)) => {
                self.session.has_failed(snapshot.version, message);
                None
            }
            Err(_) => {
                self.forget();
                let message =
                    "a fault in the renderer; the scene can still be changed or reloaded".into();
                self.session.has_failed(snapshot.version, message);
                None
            }
        };
    }

    /// Discards everything that a panic may have left half done.
    fn forget(&mut self) {
        (self.compiled, self.refinement, self.last_moving) = (None, None, None);
        self.moving = Moving::default();
    }

    /// Renders one frame while moving, or one step of refinement. Returns the time of the next step
    /// if nothing changes.
    fn step(&mut self, snapshot: &Snapshot, is_new: bool) -> Result<Option<Instant>, String> {
        let compiled = self.compile(snapshot)?;
        if is_new {
            self.refinement = None;
            let begun = Instant::now();
            self.preview(snapshot, &compiled)?;
            self.last_moving = Some((self.frame, begun));
            self.session.has_shown(snapshot.version);
            return Ok(Some(snapshot.moved + REST));
        }
        self.last_moving = None;
        Ok(self.refine(snapshot, &compiled)?.then(Instant::now))
    }

    fn compile(&mut self, snapshot: &Snapshot) -> Result<Arc<CompiledScene>, String> {
        let Snapshot { generation, geometry, placement, ref scene, .. } = *snapshot;
        if let Some(known) = self.compiled.as_ref().filter(|known| known.generation == generation) {
            return Ok(known.compiled.clone());
        }
        let before = self.compiled.take();
        let changed = match before.filter(|known| known.geometry == geometry) {
            Some(known) if known.placement == placement => {
                known.compiled.changed(&known.scene, scene).map_err(|e| e.to_string())?
            }
            Some(known) => self.moved(known, snapshot)?,
            None => None,
        };
        let compiled = match changed {
            Some(compiled) => compiled,
            None => {
                self.budget.reset();
                compiled_anew(snapshot, None)?
            }
        };
        let compiled = Arc::new(compiled);
        self.compiled = Some(Compiled {
            generation,
            geometry,
            placement,
            scene: scene.clone(),
            compiled: compiled.clone(),
        });
        self.session.set_compiled(generation, &compiled);
        Ok(compiled)
    }

    /// The scene in other places, made from the parts of the one before, unless someone else still
    /// looks at that one.
    fn moved(
        &self,
        before: Compiled,
        snapshot: &Snapshot,
    ) -> Result<Option<CompiledScene>, String> {
        lock(&self.session.compiled).take();
        let previous = Arc::into_inner(before.compiled);
        let keeps = previous.is_some();
        let compiled = compiled_anew(snapshot, previous)?;
        if !keeps {
            return Ok(Some(compiled));
        }
        // Only places were taken over: materials, lights and surroundings may differ too.
        compiled.changed(&before.scene, &snapshot.scene).map_err(|e| e.to_string())
    }

    fn preview(
        &mut self,
        snapshot: &Snapshot,
        compiled: &Arc<CompiledScene>,
    ) -> Result<(), String> {
        let start = Instant::now();
        let size = self.budget.size(snapshot.settings.size);
        let view = self.view(snapshot, compiled);
        let (shown, rgb) = self.moving.next(&view, size);
        let header = self.header(snapshot, shown, start.elapsed());
        self.encoder.send(Picture { header, rgb, display: Some(snapshot.display) })?;
        // The time includes the wait for the encoder, if that is the bottleneck.
        self.budget.spent(size, start.elapsed().as_secs_f64());
        Ok(())
    }

    fn view<'v>(&self, snapshot: &'v Snapshot, compiled: &'v CompiledScene) -> View<'v> {
        View {
            compiled,
            camera: &snapshot.camera,
            settings: &snapshot.settings,
            generation: [snapshot.generation, snapshot.geometry, snapshot.light],
            threads: self.threads,
        }
    }

    /// Renders one step of the picture at rest; true if there is more to do.
    fn refine(
        &mut self,
        snapshot: &Snapshot,
        compiled: &Arc<CompiledScene>,
    ) -> Result<bool, String> {
        let (settings, version) = (&snapshot.settings, snapshot.version);
        let (threads, keep_going) =
            (self.threads, |_: &Progress| self.session.version() == version);
        let start = Instant::now();
        let slice = self.slice;
        let goes_on = |progress: &Progress| {
            keep_going(progress) && slice.is_none_or(|slice| start.elapsed() < slice)
        };
        let unguided = Settings { guiding: None, noise: None, ..settings.clone() };
        let quick = Job::new(compiled, &snapshot.camera, &unguided);
        let whole = Job::new(compiled, &snapshot.camera, settings);
        let mut refinement = match self.refinement.take().filter(|r| r.version == version) {
            Some(known)
                if known.is_quick && known.underway.samples() >= QUICK.min(settings.spp) =>
            {
                self.session
                    .tell(ToPage::Busy { message: "learning where light comes from".into() });
                let underway = whole.begin(threads, &keep_going);
                self.session.tell(ToPage::Busy { message: String::new() });
                Refinement { underway, is_quick: false, until: 0, ..known }
            }
            Some(known) => known,
            None => {
                // Memory may have become scarce since the size was accepted.
                fits(settings)?;
                self.session.tell_view();
                let checkpoint = self.session.checkpoint(snapshot);
                let kept =
                    checkpoint.as_ref().and_then(|kept| self.kept(kept, &whole, &keep_going));
                let is_quick = settings.guiding.is_some() && kept.is_none();
                let job = if is_quick { &quick } else { &whole };
                let underway = kept.unwrap_or_else(|| job.begin(threads, &keep_going));
                Refinement {
                    version,
                    settings: settings.clone(),
                    underway,
                    checkpoint,
                    is_quick,
                    until: 0,
                    spent: Duration::ZERO,
                    due: None,
                    is_complete: false,
                    resting: None,
                }
            }
        };
        if refinement.is_complete {
            self.refinement = Some(refinement);
            return Ok(false);
        }
        let job = if refinement.is_quick { &quick } else { &whole };
        let samples = refinement.underway.samples();
        if samples >= refinement.until {
            refinement.until = next_pass(samples, refinement.spent);
        }
        let until = refinement.until;
        let has_more =
            job.go_on(&mut refinement.underway, until, threads, &goes_on) || refinement.is_quick;
        refinement.spent += start.elapsed();
        if self.session.version() != version {
            // If the view ends, this is kept.
            self.refinement = Some(refinement);
            return Ok(false);
        }
        // A pass that ends with the slice is not shown: some pixels have fewer samples than others.
        if has_more && !refinement.underway.statistics.is_complete {
            self.refinement = Some(refinement);
            return Ok(true);
        }
        refinement.is_complete = !has_more;
        if !has_more || refinement.checkpoint.as_ref().is_some_and(Saved::is_due) {
            refinement.save(self.session);
        }
        // Until the new picture has as many samples, the quick one is better.
        let is_worse = settings.guiding.is_some()
            && !refinement.is_quick
            && refinement.underway.samples() < QUICK;
        let is_due = !is_worse && refinement.due.is_none_or(|due| due <= Instant::now());
        if !has_more || is_due {
            let begin = Instant::now();
            self.publish(snapshot, compiled, &mut refinement)?;
            let spent = begin.elapsed();
            refinement.due = Some(Instant::now() + REST_INTERVAL.max(spent * REST_SHARE));
        }
        self.refinement = Some(refinement);
        Ok(has_more)
    }

    /// The picture in the file that keeps it, if it is that of the job.
    fn kept(
        &self,
        checkpoint: &Checkpoint,
        job: &Job,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Option<Underway> {
        let (resume, words) = (Resume::IfSame, Wording::COMMAND);
        match checkpoint.restore(job, resume, words, self.threads, keep_going) {
            Ok(kept) => {
                let (underway, warning) = kept?;
                warning
                    .into_iter()
                    .for_each(|message| self.session.tell(ToPage::Error { message }));
                Some(underway)
            }
            Err(problem) => {
                self.session.tell(ToPage::Error { message: problem.to_string() });
                None
            }
        }
    }

    /// Shows the current picture at rest: a denoised one that fades into the true samples.
    fn publish(
        &mut self,
        snapshot: &Snapshot,
        compiled: &Arc<CompiledScene>,
        refinement: &mut Refinement,
    ) -> Result<(), String> {
        let settings = &snapshot.settings;
        let film = &refinement.underway.film;
        let samples = film.mean_samples();
        let image = picture(film, settings, compiled);
        let mut rgb = rgb_of(&image);
        let taken = samples as u32;
        let wanted = if refinement.is_complete { taken } else { settings.spp.max(taken + 1) };
        let noise = if taken >= 4 { noise_of(film, &rgb) } else { f32::NAN };
        let mut denoised = 0.0;
        let view = self.view(snapshot, compiled);
        if view.is_lit() && is_denoised(settings.size) {
            let resting =
                refinement.resting.get_or_insert_with(|| Resting::new(&view, &self.moving));
            denoised = denoised_share(samples as f32, wanted as f32, noise);
            let (smooth, lit) = self.denoise(refinement.version, resting, &rgb, samples as f32);
            // Of the true samples, every bit is shown.
            if denoised > 0.0 {
                for (value, smooth) in rgb.iter_mut().zip(smooth.as_flattened()) {
                    *value += (smooth - *value) * denoised;
                }
            }
            self.moving.rest(&view, lit);
        }
        let header = FrameHeader {
            kind: 1,
            samples: taken,
            wanted,
            noise,
            denoised,
            ..self.header(snapshot, settings.size, refinement.spent)
        };
        self.encoder.send(Picture { header, rgb, display: None })?;
        // The quick picture during training is none that `snell render` makes.
        if !refinement.is_quick {
            let Underway { film, statistics, .. } = &refinement.underway;
            let finished = Finished {
                scene: snapshot.scene.clone(),
                compiled: compiled.clone(),
                settings: settings.clone(),
                film: film.clone(),
                statistics: *statistics,
                is_whole: refinement.is_complete,
            };
            *lock(&self.session.finished) = Some((refinement.version, Arc::new(finished)));
        }
        Ok(())
    }

    /// The denoised picture, and the light in it. Open Image Denoise begins anew when there are
    /// several times the samples; meanwhile, the viewer's own filter denoises.
    fn denoise(
        &self,
        version: u64,
        resting: &Resting,
        rgb: &[f32],
        samples: f32,
    ) -> (Arc<Vec<Color>>, Lit) {
        let clean = self.learned.newest(version);
        if samples >= LEARNED && clean.as_ref().is_none_or(|c| samples >= LEARNED * c.samples) {
            let (surfaces, rgb) = (resting.surfaces.clone(), rgb.to_vec());
            self.learned.begin(Raw { version, samples, rgb, surfaces });
        }
        match clean {
            Some(clean) => (clean.colors.clone(), resting.light_of(&clean)),
            None => {
                let denoised = resting.denoised(rgb, samples);
                (Arc::new(denoised.colors), denoised.lit)
            }
        }
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
            denoised: 0.0,
        }
    }
}

#[cfg(feature = "server")]
impl<'a> Worker<'a> {
    /// Renders for a session until it ends, on threads of its own: this number of them, and
    /// one that encodes, at this number of frames per second.
    pub fn run(session: &'a Session, threads: usize, frames_per_second: f64) {
        std::thread::scope(|scope| {
            let encoder = Encoder::beside(scope, session);
            let learned = Learned::new(scope, threads);
            Self::new(session, threads, frames_per_second, encoder, learned).work();
        });
    }

    /// Renders until the session ends. A panic in a picture is reported to the pages, and the next
    /// change is rendered again.
    fn work(mut self) {
        // No page is open yet; compiling now saves the first page the wait. A failure here repeats,
        // and is reported, when a page is open.
        let _ = catch_unwind(AssertUnwindSafe(|| self.compile(&self.session.now())));
        while let Some(snapshot) = self.next() {
            self.serve(&snapshot);
        }
        // The view ends.
        if let Some(refinement) = &mut self.refinement {
            refinement.save(self.session);
        }
    }

    /// The next state to render. Waits until it is due, and until a page has shown an earlier
    /// picture.
    fn next(&self) -> Option<Snapshot> {
        if let Some((last, _)) = self.last_moving {
            self.session.pace.wait_for(last.wrapping_sub(UNSEEN), PATIENCE);
        }
        self.session.wait(self.seen, self.due)
    }
}

impl Refinement {
    /// Saves the picture, if it is kept in a file.
    fn save(&mut self, session: &Session) {
        let Some(checkpoint) = self.checkpoint.as_mut().filter(|_| !self.is_quick) else { return };
        if let Some(message) = checkpoint.write(&self.underway, &self.settings) {
            session.tell(ToPage::Error { message });
        }
    }
}

/// Compiles a scene, with what did not move of a previous one.
fn compiled_anew(
    snapshot: &Snapshot,
    previous: Option<CompiledScene>,
) -> Result<CompiledScene, String> {
    let moving = snell_render::Moving { nodes: (*snapshot.moving).clone(), later: Vec::new() };
    CompiledScene::moving(&snapshot.scene, &moving, &snapshot.settings.build, previous)
        .map_err(|e| e.to_string())
}

/// Samples per pixel after the next step, when so many took this long. Steps are short, so that
/// what is shown becomes better steadily.
fn next_pass(samples: u32, spent: Duration) -> u32 {
    match samples {
        0 => 1,
        1..4 => 4,
        _ => {
            let in_time = STEP.as_secs_f64() / (spent.as_secs_f64() / f64::from(samples)).max(1e-9);
            samples + (in_time as u32).clamp(1, 16)
        }
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
