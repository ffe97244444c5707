//! Every accelerator, kernel, level, batch size and thread count finds the same hits, bit for bit, in random worlds of mixed
//! shapes, meshes and instances.
//!
//! `SNELL_RANDOM_WORLDS` sets how many worlds (250 by default).

use rayon::prelude::*;
use snell_tests::random_worlds::{assert_agreement, random_bytes};

#[test]
fn random_worlds_give_the_same_hits_in_every_way() {
    let worlds: u32 = std::env::var("SNELL_RANDOM_WORLDS").ok().and_then(|s| s.parse().ok()).unwrap_or(250);
    let (rays, hits) = (0..worlds)
        .into_par_iter()
        .map(|seed| assert_agreement(&random_bytes(seed, 12_000), 40, &[1, 2, 15, 16, 17, 4096]))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    println!("{worlds} worlds, {rays} rays, {hits} hit something");
    assert!(hits > rays / 5, "{hits} of {rays}");
}

#[test]
#[ignore = "a look at one world: SNELL_RANDOM_WORLD=SEED"]
fn one_random_world_gives_the_same_hits_in_every_way() {
    let seed = std::env::var("SNELL_RANDOM_WORLD").ok().and_then(|s| s.parse().ok()).unwrap_or(0);
    assert_agreement(&random_bytes(seed, 12_000), 40, &[]);
}
