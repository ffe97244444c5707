//! Prints what random rays hit in so many random worlds, at the level of `SNELL_SIMD`: how many
//! rays there were, how many hit something, and a hash of all hits. `cargo xtask bits` runs it.

use snell_lab::bits::{RAYS_PER_WORLD, random_rays};
use snell_math::simd::Level;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(worlds) = std::env::args().nth(1).and_then(|count| count.parse().ok()) else {
        eprintln!("random_rays: give it a number of worlds");
        return ExitCode::from(2);
    };
    let answers = Level::from_env()
        .and_then(|level| random_rays(0..worlds, level).map_err(|error| error.to_string()));
    match answers {
        Ok(answers) => {
            let rays = u64::from(worlds) * u64::from(RAYS_PER_WORLD);
            println!("{rays} {} {:016x}", answers.hits, answers.digest);
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("random_rays: {error}");
            ExitCode::FAILURE
        }
    }
}
