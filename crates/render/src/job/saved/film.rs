//! The film of a checkpoint: rows of tiles.

use super::header::Header;
use super::{Fact, chunk};
use crate::film::tile::TileState;
use crate::film::{Film, FilmTile, noise};
use crate::job::empty_film;
use crate::settings::Settings;
use chunk::{SavedError, damaged};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// No pixel is checked more often before its samples are too many to be counted.
const MOST_LOOKS: usize = 200;

/// The number of rows of tiles that are compressed at a time.
const ROWS_AT_ONCE: usize = 16;

#[derive(Serialize, Deserialize)]
struct SavedTile {
    state: TileState,
    /// The active pixels of the tile; `None` if all are active.
    active: Option<Vec<u32>>,
}

/// The tiles of a film, row by row.
pub(super) fn rows(film: &Film) -> impl Iterator<Item = &[FilmTile]> {
    film.tiles.chunk_by(|a, b| a.area.min[1] == b.area.min[1])
}

/// Writes the rows of a film, with the active pixels of all of its tiles.
pub(super) fn write_rows(
    film: &Film,
    mut active: &[Option<Vec<u32>>],
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let rows: Vec<&[FilmTile]> = rows(film).collect();
    for rows in rows.chunks(ROWS_AT_ONCE) {
        let mut together = Vec::with_capacity(rows.len());
        for row in rows {
            let (of_row, rest) = active.split_at(row.len());
            together.push((*row, of_row));
            active = rest;
        }
        let packed = |&(row, active): &(&[FilmTile], &[Option<Vec<u32>>])| {
            let tile = |(tile, active): (&FilmTile, &Option<Vec<u32>>)| SavedTile {
                state: tile.state(),
                active: active.clone(),
            };
            chunk::pack(&row.iter().zip(active).map(tile).collect::<Vec<_>>())
        };
        let chunks: Vec<_> = together.par_iter().map(packed).collect();
        for chunk in chunks {
            out.write_all(&chunk?)?;
        }
    }
    Ok(())
}

/// Reads the tiles of an empty film, and the active pixels of each.
pub(super) fn read_rows(
    film: &mut Film,
    input: &mut dyn Read,
) -> Result<Vec<Option<Vec<u32>>>, SavedError> {
    let mut active = Vec::with_capacity(film.tiles.len());
    let mut tiles = Vec::with_capacity(film.tiles.len());
    for row in rows(film) {
        let saved: Vec<SavedTile> = chunk::read(input)?;
        if saved.len() != row.len() {
            return damaged("a row has another number of tiles");
        }
        for (tile, saved) in row.iter().zip(saved) {
            let count = tile.pixels() as u32;
            let is_valid = saved.active.as_ref().is_none_or(|pixels| {
                pixels.is_sorted_by(|a, b| a < b) && pixels.last().is_none_or(|&p| p < count)
            });
            match tile.with_state(saved.state).filter(|_| is_valid) {
                Some(tile) => tiles.push(tile),
                None => return damaged("a tile is not of this picture"),
            }
            active.push(saved.active);
        }
    }
    film.tiles = tiles;
    Ok(active)
}

/// Reads a film and the active pixels of its tiles.
pub(super) fn read_film(
    settings: &Settings,
    input: &mut dyn Read,
    facts: &[Fact],
) -> Result<(Header, Film, Vec<Option<Vec<u32>>>), SavedError> {
    let header = Header::read(input)?;
    if let Some(difference) = header.difference(facts) {
        return Err(SavedError::Other(difference.to_string()));
    }
    let mut film = empty_film(settings);
    let layers = film.aovs().iter().map(|aov| aov.name());
    if header.crop != film.crop
        || header.size != settings.size
        || !layers.eq(header.layers.iter().map(String::as_str))
    {
        return Err(SavedError::Other("its size or layers differ".into()));
    }
    let active = read_rows(&mut film, input)?;
    let most = film.most_samples();
    if most > settings.spp {
        let spp = settings.spp;
        return Err(SavedError::Other(format!(
            "it has {most} samples already, and --spp is {spp} now"
        )));
    }
    let (samples, look) = (header.samples, header.look);
    let mut looks =
        std::iter::successors(Some(noise::next_look(0)), |&n| Some(noise::next_look(n)));
    let is_filled = |(tile, active): (&FilmTile, &Option<Vec<u32>>)| {
        active.as_ref().is_some_and(Vec::is_empty) || tile.samples() >= samples
    };
    // Only pixels that stop by their error are checked.
    let is_checked = settings.noise.is_some();
    if is_checked && samples > look
        || looks.by_ref().take(MOST_LOOKS).find(|&known| known >= look) != Some(look)
        || !film.tiles.iter().zip(&active).all(is_filled)
    {
        return damaged("its numbers of samples do not fit");
    }
    Ok((header, film, active))
}
