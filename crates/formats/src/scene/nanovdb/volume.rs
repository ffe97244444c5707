//! Reads the grids of a NanoVDB file as dense grids.

use crate::expansion::Compression;
use crate::{Input, Place, ReadError};
use nanovdb_rs::{
    Codec, GridClass, GridDataHeader, GridMetadata, GridType, ReadAccessor, SegmentHeader,
    ValidatedFloatTree,
};
use rayon::prelude::*;
use snell_math::{DAffine3, DMat3, DVec3};
use snell_scene::medium::ScalarGrid;
use std::borrow::Cow;

/// Magic number of files before version 32.6 of the format.
const MAGIC: &[u8] = b"NanoVDB0";
/// Magic number of files since version 32.6, which have the same layout.
const NEW_MAGIC: &[u8] = b"NanoVDB2";
/// Magic number of a grid in memory, which some programs write without a file header.
const GRID_MAGIC: &[u8] = b"NanoVDB1";

/// The supported major version.
const VERSION: u32 = 32;

/// Maximum number of cells of a grid: 1 GiB.
const MAX_CELLS: usize = 1 << 28;

/// Maximum number of comparisons of a cell with a tile of the root. Real files are far below; the
/// limit is for files made to take forever.
const MAX_SEARCH: u64 = 1 << 34;

/// True for files that [`Volumes`] reads or can report errors in.
pub fn recognises(bytes: &[u8]) -> bool {
    [MAGIC, NEW_MAGIC, GRID_MAGIC].iter().any(|magic| bytes.starts_with(magic))
}

/// A grid of numbers and its place in the world.
#[derive(Clone, Debug)]
pub struct Volume {
    /// The values over the box of the active voxels, with one more voxel on each side, so that the
    /// values fade to the background as in the file.
    pub grid: ScalarGrid,
    /// The transform from the grid's unit cube to the world of the file.
    pub world_from_grid: DAffine3,
}

impl Volume {
    /// The values of this volume at the cells of `other`; 0 outside this volume's box.
    pub fn over(&self, other: &Self) -> ScalarGrid {
        let size = other.grid.size();
        let cells = DVec3::from_array(size.map(|n| n as f64));
        let here = self.world_from_grid.inverse() * other.world_from_grid;
        let value = |i: usize| {
            let cell =
                [i % size[0], i / size[0] % size[1], i / size[0] / size[1]].map(|c| c as f64 + 0.5);
            self.grid.lookup(here.transform_point3(DVec3::from_array(cell) / cells).as_vec3())
        };
        let values = (0..size.iter().product()).into_par_iter().map(value).collect();
        ScalarGrid::new(size, values).unwrap_or_default()
    }
}

/// The grids of a file.
#[derive(Debug)]
pub struct Volumes<'a> {
    input: &'a Input,
    entries: Vec<Entry<'a>>,
}

/// A grid in the file.
#[derive(Debug)]
struct Entry<'a> {
    about: GridMetadata,
    codec: Codec,
    /// The bytes of the grid as stored in the file.
    bytes: &'a [u8],
    /// The offset of these bytes in the file.
    at: usize,
}

const REMEDY: &str = "export the grid again as 32-bit floats, uncompressed or compressed with zip";
const CUT_OFF: &str = "the file seems cut off; copy or export it again";

impl<'a> Volumes<'a> {
    /// Finds the grids of a file.
    ///
    /// # Errors
    /// If the file is not NanoVDB of a supported version, or ends too early.
    pub fn of(input: &'a Input) -> Result<Self, ReadError> {
        let bytes = &input.bytes;
        let fault = |at: usize, problem: String, remedy: &str| {
            input.error(Place::Byte(at as u64), problem, remedy)
        };
        if bytes.starts_with(GRID_MAGIC) {
            return Err(fault(
                0,
                "this is a grid without the header of a NanoVDB file".into(),
                REMEDY,
            ));
        }
        let mut entries = Vec::new();
        let mut next = 0;
        while next < bytes.len() {
            let Some(header) = bytes.get(next..next + SegmentHeader::BYTE_SIZE) else {
                return Err(fault(next, "the file ends within a header".into(), CUT_OFF));
            };
            let mut header = header.to_vec();
            if header.starts_with(NEW_MAGIC) {
                header[..MAGIC.len()].copy_from_slice(MAGIC);
            }
            let header = SegmentHeader::parse(&header, next as u64).map_err(|_| {
                fault(next, "there is no header of a NanoVDB file here".into(), CUT_OFF)
            })?;
            if header.version.major() != VERSION {
                let problem = format!(
                    "this is NanoVDB {}, and only version {VERSION} is known",
                    header.version
                );
                return Err(fault(next, problem, "export it with OpenVDB 8 or later"));
            }
            next += SegmentHeader::BYTE_SIZE;
            let mut about = Vec::new();
            for _ in 0..header.grid_count {
                let (grid, length) =
                    GridMetadata::parse(&bytes[next.min(bytes.len())..]).map_err(|_| {
                        fault(
                            next,
                            "the file ends within the description of a grid".into(),
                            CUT_OFF,
                        )
                    })?;
                about.push(grid);
                next += length;
            }
            for about in about {
                let packed = match header.codec {
                    Codec::Zip => {
                        let size = bytes
                            .get(next..next + 8)
                            .and_then(|size| size.try_into().ok())
                            .map(u64::from_le_bytes);
                        next += 8;
                        size
                    }
                    _ => Some(about.grid_size),
                };
                let end = packed
                    .and_then(|size| usize::try_from(size).ok())
                    .and_then(|size| next.checked_add(size));
                let Some(content) = end.and_then(|end| bytes.get(next..end)) else {
                    return Err(fault(
                        next,
                        format!("the file ends within the grid \"{}\"", about.name),
                        CUT_OFF,
                    ));
                };
                entries.push(Entry { about, codec: header.codec, bytes: content, at: next });
                next += content.len();
            }
        }
        Ok(Self { input, entries })
    }

    /// Names of the grids.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.about.name.as_str())
    }

    /// The grid of this name over its own box, if there is one.
    ///
    /// # Errors
    /// If the values of the grid are not floats, or if it is damaged or too large.
    pub fn volume(&self, name: &str) -> Result<Option<Volume>, ReadError> {
        crate::guard::guarded(|| self.read(name)).unwrap_or_else(|| {
            let problem = format!("the grid \"{name}\" is damaged: its decoder failed");
            Err(self.input.error(Place::Whole, problem, REMEDY))
        })
    }

    fn read(&self, name: &str) -> Result<Option<Volume>, ReadError> {
        let Some(entry) = self.entries.iter().find(|entry| entry.about.name == name) else {
            return Ok(None);
        };
        if entry.about.grid_class == GridClass::LevelSet {
            let problem =
                format!("the grid \"{name}\" is a level set, which is a surface, not a density");
            return Err(self.fault(entry, problem, "export it as a fog volume"));
        }
        let bytes = self.unpacked(entry)?;
        let map = self.map(entry, &bytes)?;
        let (low, high) = (entry.about.index_bbox_min, entry.about.index_bbox_max);
        let extent = [0, 1, 2].map(|i| i64::from(high[i]) - i64::from(low[i]) + 3);
        // An empty grid.
        if extent.iter().any(|n| *n < 3) {
            return Ok(Some(Volume { grid: ScalarGrid::default(), world_from_grid: map }));
        }
        let size = extent.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let most = MAX_CELLS.min(self.input.options.limits.elements);
        let count = size[0]
            .checked_mul(size[1])
            .and_then(|n| n.checked_mul(size[2]))
            .filter(|n| *n <= most);
        let search = |n: usize| (n as u64).saturating_mul(tiles(&bytes) as u64);
        let Some(count) = count.filter(|&n| search(n) <= MAX_SEARCH) else {
            let problem = format!(
                "the grid \"{name}\" has a box of {} x {} x {} voxels; up to {most} in all are \
                    read",
                extent[0], extent[1], extent[2]
            );
            return Err(self.fault(entry, problem, "resample it with larger voxels"));
        };
        self.input.charge(count as u64 * 4, &format!("the grid \"{name}\""))?;
        let first = low.map(|x| i64::from(x) - 1);
        let [nx, ny, _] = size;
        let mut values = vec![0.0; count];
        // Indices beyond the voxel range are background.
        let index = |x: i64| x.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        values.par_chunks_mut(nx * ny).enumerate().for_each(|(z, layer)| {
            let Some(mut reader) = ReadAccessor::<f32>::from_grid_bytes(&bytes) else { return };
            for (y, row) in layer.chunks_mut(nx).enumerate() {
                for (x, value) in row.iter_mut().enumerate() {
                    let cell = [x, y, z].map(|c| c as i64);
                    *value = reader.get_value([0, 1, 2].map(|i| index(first[i] + cell[i])));
                }
            }
        });
        // Values are at the lattice corners, which are the centres of our cells.
        let corner = DVec3::from_array(first.map(|x| x as f64 - 0.5));
        let scale = DVec3::from_array(size.map(|n| n as f64));
        let world_from_grid =
            map * DAffine3::from_translation(corner) * DAffine3::from_scale(scale);
        Ok(ScalarGrid::new(size, values).map(|grid| Volume { grid, world_from_grid }))
    }

    fn fault(&self, entry: &Entry, problem: impl Into<String>, remedy: &str) -> ReadError {
        self.input.error(Place::Byte(entry.at as u64), problem, remedy)
    }

    /// The grid's bytes, decompressed and checked so that lookups cannot fail.
    fn unpacked<'b>(&self, entry: &Entry<'b>) -> Result<Cow<'b, [u8]>, ReadError> {
        let name = &entry.about.name;
        if entry.about.grid_type != GridType::Float {
            let problem =
                format!("the grid \"{name}\" is of {:?}, not of floats", entry.about.grid_type);
            return Err(self.fault(entry, problem, REMEDY));
        }
        let bytes = match entry.codec {
            Codec::None => Cow::Borrowed(entry.bytes),
            Codec::Zip => {
                let content = self.input.unpack(
                    entry.bytes,
                    Compression::Zlib,
                    Place::Byte(entry.at as u64),
                )?;
                if content.len() as u64 != entry.about.grid_size {
                    let problem =
                        format!("the grid \"{name}\" is damaged: it does not unpack to its size");
                    return Err(self.fault(entry, problem, CUT_OFF));
                }
                Cow::Owned(content)
            }
            Codec::Blosc | Codec::Other => {
                let problem = format!(
                    "the grid \"{name}\" is compressed with {:?}, which is not supported",
                    entry.codec
                );
                return Err(self.fault(entry, problem, REMEDY));
            }
        };
        if ValidatedFloatTree::new(&bytes).is_none() {
            return Err(self.fault(
                entry,
                format!("the tree of the grid \"{name}\" is damaged"),
                CUT_OFF,
            ));
        }
        Ok(bytes)
    }

    /// The transform from voxel indices to the world.
    fn map(&self, entry: &Entry, bytes: &[u8]) -> Result<DAffine3, ReadError> {
        let map = GridDataHeader::parse(bytes).map(|header| header.map).map(|map| DAffine3 {
            matrix3: DMat3::from_cols_array_2d(&map.mat_d).transpose(),
            translation: DVec3::from_array(map.vec_d),
        });
        let is_sound = |map: &DAffine3| map.is_finite() && map.matrix3.determinant().is_normal();
        map.filter(is_sound).ok_or_else(|| {
            let problem = format!(
                "the grid \"{}\" has no place in the world: its map is singular",
                entry.about.name
            );
            self.fault(entry, problem, "export the grid again")
        })
    }
}

/// The number of root tiles of a tree that has been validated.
fn tiles(bytes: &[u8]) -> usize {
    let Some((tree, _)) = ReadAccessor::<f32>::parse_tree_data(bytes) else { return 0 };
    let at = nanovdb_rs::GRID_DATA_SIZE + tree.root_offset() as usize + 24;
    bytes.get(at..at + 4).and_then(|n| n.try_into().ok()).map_or(0, u32::from_le_bytes) as usize
}
