//! What a render saves on its way: its state, and a preview of the picture.

use super::checkpoint::resume;
use super::options::Options;
use super::preview::Preview;
use crate::failure::Failure;
use snell_persist::{Checkpoint, Saved, Wording};
use snell_render::{Film, Job, Progress, Statistics};

/// What is saved on the way.
pub struct Saving<'a> {
    pub options: &'a Options,
    pub checkpoint: Option<Checkpoint>,
    pub preview: Option<Preview<'a>>,
}

impl Saving<'_> {
    /// Renders until all samples are taken or `keep_going` returns false, and saves from time to
    /// time and at the end.
    pub fn run(
        &mut self,
        job: &Job,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Result<(Film, Statistics), Failure> {
        let Self { options, checkpoint, preview } = self;
        let mut warn = |warning: String| {
            if !options.quiet {
                eprintln!("warning: {warning}");
            }
        };
        let mut underway = match checkpoint {
            Some(checkpoint) => {
                let resume = resume(options);
                let (underway, warning) =
                    checkpoint.begin(job, resume, Wording::COMMAND, threads, keep_going)?;
                warning.into_iter().for_each(&mut warn);
                underway
            }
            None => job.begin(threads, keep_going),
        };
        let checkpoint = checkpoint.iter_mut().map(|checkpoint| checkpoint as &mut dyn Saved);
        let preview = preview.iter_mut().map(|preview| preview as &mut dyn Saved);
        let mut saved: Vec<_> = checkpoint.chain(preview).collect();
        let spp = job.settings().spp;
        snell_persist::go_on(job, &mut underway, spp, threads, keep_going, &mut saved, &mut warn);
        Ok((underway.film, underway.statistics))
    }
}
