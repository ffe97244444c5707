//! Progress: one live line on a terminal, plain lines elsewhere, or JSON.

use indicatif::{ProgressBar, ProgressStyle};
use snell_render::{Progress, Training};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// The style of the progress display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ProgressStyleOption {
    /// A live line on a terminal, plain lines otherwise.
    #[default]
    Auto,
    /// Plain lines.
    Plain,
    /// One JSON object per line, on standard error.
    Json,
    /// No progress is shown.
    None,
}

enum Style {
    Live(ProgressBar),
    Plain,
    Json,
    Silent,
}

/// Shows the progress of a render. Its methods may be called from any thread.
pub struct Reporter {
    style: Style,
    start: Instant,
    interval: Duration,
    next: Mutex<Instant>,
    scene: String,
}

impl Reporter {
    /// A reporter for a render of this scene.
    pub fn new(option: ProgressStyleOption, quiet: bool, scene: &str) -> Self {
        let live = std::io::stderr().is_terminal();
        let style = match option {
            _ if quiet => Style::Silent,
            ProgressStyleOption::None => Style::Silent,
            ProgressStyleOption::Json => Style::Json,
            ProgressStyleOption::Plain => Style::Plain,
            ProgressStyleOption::Auto if live => {
                let bar = ProgressBar::new(1000);
                let template = "{prefix} {percent:>3} %  |{bar:30}|  {msg}";
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style.progress_chars("## "));
                }
                bar.set_prefix(scene.to_string());
                Style::Live(bar)
            }
            ProgressStyleOption::Auto => Style::Plain,
        };
        let interval = match style {
            Style::Live(_) => Duration::from_millis(100),
            Style::Json => Duration::from_millis(250),
            _ => Duration::from_secs(5),
        };
        let start = Instant::now();
        Self {
            style,
            start,
            interval,
            next: Mutex::new(start + interval),
            scene: scene.to_string(),
        }
    }

    /// The seconds since the start, if enough time has passed since the last output; else `None`.
    fn due(&self) -> Option<f64> {
        let now = Instant::now();
        let mut next = self.next.try_lock().ok().filter(|next| now >= **next)?;
        *next = now + self.interval;
        Some(now.duration_since(self.start).as_secs_f64())
    }

    /// Shows progress, if enough time has passed since the last output. `limit` is the time limit,
    /// if any.
    pub fn update(&self, progress: &Progress, limit: Option<Duration>) {
        let Some(seconds) = self.due() else { return };
        let by_samples = progress.done as f64 / progress.total.max(1) as f64;
        let share =
            limit.map_or(by_samples, |l| (seconds / l.as_secs_f64()).max(by_samples)).min(1.0);
        let rate = progress.rays as f64 / seconds / 1e6;
        let left = if share > 0.0 { seconds * (1.0 - share) / share } else { 0.0 };
        match &self.style {
            Style::Live(bar) => {
                bar.set_position((share * 1000.0) as u64);
                bar.set_message(format!("{rate:.1} Mrays/s  {} left", duration(left)));
            }
            Style::Plain => {
                eprintln!(
                    "{} {:.0} %  {rate:.1} Mrays/s  {} left",
                    self.scene,
                    share * 100.0,
                    duration(left)
                )
            }
            Style::Json => eprintln!(
                "{}",
                serde_json::json!({
                    "scene": self.scene, "done": share, "samples": progress.done,
                    "samples_total": progress.total, "rays": progress.rays,
                    "mrays_per_second": rate, "seconds": seconds, "seconds_left": left,
                })
            ),
            Style::Silent => {}
        }
    }

    /// Shows the progress of path-guiding training, if enough time has passed since the last
    /// output.
    pub fn update_training(&self, training: &Training) {
        let Some(seconds) = self.due() else { return };
        let (pass, share) =
            (training.pass + 1, training.begun as f64 / training.parts.max(1) as f64);
        match &self.style {
            Style::Live(bar) => {
                bar.set_message(format!("learning where light comes from, pass {pass}"))
            }
            Style::Plain => {
                eprintln!(
                    "{} learning where light comes from, pass {pass}, {:.0} %",
                    self.scene,
                    share * 100.0
                )
            }
            Style::Json => eprintln!(
                "{}",
                serde_json::json!({
                    "scene": self.scene, "training_pass": pass, "training_pass_done": share,
                    "seconds": seconds,
                })
            ),
            Style::Silent => {}
        }
    }

    /// Removes the live line.
    pub fn finish(&self) {
        if let Style::Live(bar) = &self.style {
            bar.finish_and_clear();
        }
    }
}

/// A duration as text: `0.8s`, `42s`, `3m07s`, `2h05m`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        _ if seconds < 9.95 => format!("{seconds:.1}s"),
        0..60 => format!("{whole}s"),
        60..3600 => format!("{}m{:02}s", whole / 60, whole % 60),
        _ => format!("{}h{:02}m", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn durations_read_well() {
        assert_eq!([0.84, 42.3, 187.0, 7500.0].map(duration), ["0.8s", "42s", "3m07s", "2h05m"]);
    }
}
