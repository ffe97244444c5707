//! The library's functions, and denoising with them.

use crate::{DenoiseError, Noisy, find};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr;

/// `OIDNDevice`, `OIDNFilter`: opaque.
type Handle = *mut c_void;

/// `OIDN_DEVICE_TYPE_CPU`: this device uses the memory of the process, and its results do not
/// depend on a graphics card.
const DEVICE_TYPE_CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`: images of three floats per pixel.
const FORMAT_FLOAT3: c_int = 3;
/// `OIDN_ERROR_NONE`: no error.
const ERROR_NONE: c_int = 0;

macro_rules! functions {
    ($($name:ident: $symbol:literal $type:ty,)*) => {
        struct Functions {
            $($name: $type,)*
        }

        impl Functions {
            /// # Safety
            /// The library must be Open Image Denoise 2, and stay loaded as long as the functions
            /// are called.
            unsafe fn find(library: &libloading::Library) -> Result<Self, &'static str> {
                Ok(Self {
                    // SAFETY: the types are those of the library's documentation; the caller
                    // guarantees the library.
                    $($name: *unsafe { library.get::<$type>($symbol) }
                        .map_err(|_| $symbol.to_str().unwrap_or("?"))?,)*
                })
            }
        }
    };
}

functions! {
    new_device: c"oidnNewDevice" unsafe extern "C" fn(c_int) -> Handle,
    set_device_int: c"oidnSetDeviceInt" unsafe extern "C" fn(Handle, *const c_char, c_int),
    commit_device: c"oidnCommitDevice" unsafe extern "C" fn(Handle),
    device_error: c"oidnGetDeviceError" unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: c"oidnReleaseDevice" unsafe extern "C" fn(Handle),
    new_filter: c"oidnNewFilter" unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: c"oidnSetSharedFilterImage" unsafe extern "C" fn(
        Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize,
    ),
    set_bool: c"oidnSetFilterBool" unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: c"oidnCommitFilter" unsafe extern "C" fn(Handle),
    execute_filter: c"oidnExecuteFilter" unsafe extern "C" fn(Handle),
    release_filter: c"oidnReleaseFilter" unsafe extern "C" fn(Handle),
}

/// The loaded library.
pub struct Denoiser {
    functions: Functions,
    /// The library is never unloaded, because its threads may live on for a while.
    _library: ManuallyDrop<libloading::Library>,
}

impl std::fmt::Debug for Denoiser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Denoiser")
    }
}

impl Denoiser {
    /// Loads the library: the file `named`, or the library in the folder `named` or in its
    /// subfolders, or else the library that the system finds.
    pub fn load(named: Option<&Path>) -> Result<Self, DenoiseError> {
        let candidates = find::candidates(named);
        let not_found = || DenoiseError::NotFound(named.map(Path::to_path_buf));
        let last = candidates.last().cloned().ok_or_else(not_found)?;
        for path in candidates {
            // SAFETY: the user asks for this library to be run; its initialisers have no
            // preconditions.
            let library = match unsafe { libloading::Library::new(&path) } {
                Ok(library) => library,
                Err(source) if named.is_some() => return Err(DenoiseError::Load { path, source }),
                Err(_) if path == last => return Err(not_found()),
                Err(_) => continue,
            };
            // SAFETY: a library of this name that has all of these functions is Open Image Denoise
            // 2, and it is never unloaded.
            let functions = unsafe { Functions::find(&library) };
            let functions = functions.map_err(|symbol| DenoiseError::Symbol { path, symbol })?;
            return Ok(Self { functions, _library: ManuallyDrop::new(library) });
        }
        Err(not_found())
    }

    /// Denoises a picture by the filter for ray tracing, on `threads` threads.
    ///
    /// # Panics
    /// If a slice does not hold three values for each pixel.
    pub fn denoise(&self, noisy: &Noisy, threads: usize) -> Result<Vec<f32>, DenoiseError> {
        let Noisy { width, height, .. } = *noisy;
        let values = width * height * 3;
        for image in [noisy.color, noisy.albedo, noisy.normal] {
            assert_eq!(image.len(), values, "three values for each pixel");
        }
        let mut output = vec![0.0f32; values];
        if values == 0 {
            return Ok(output);
        }
        let f = &self.functions;
        let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
        // SAFETY: handles are used only while they live, names end with a zero, and all images have
        // `values` floats and outlive the filter. The library reads the three inputs and writes the
        // output alone, and only before `execute_filter` returns.
        unsafe {
            let device = (f.new_device)(DEVICE_TYPE_CPU);
            if device.is_null() {
                return Err(self.error(ptr::null_mut()));
            }
            (f.set_device_int)(device, c"numThreads".as_ptr(), threads);
            (f.commit_device)(device);
            let filter = (f.new_filter)(device, c"RT".as_ptr());
            if filter.is_null() {
                let error = self.error(device);
                (f.release_device)(device);
                return Err(error);
            }
            let inputs =
                [(c"color", noisy.color), (c"albedo", noisy.albedo), (c"normal", noisy.normal)];
            let inputs = inputs.map(|(name, image)| (name, image.as_ptr().cast_mut()));
            for (name, image) in inputs.into_iter().chain([(c"output", output.as_mut_ptr())]) {
                (f.set_image)(
                    filter,
                    name.as_ptr(),
                    image.cast(),
                    FORMAT_FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            }
            (f.set_bool)(filter, c"hdr".as_ptr(), true);
            (f.commit_filter)(filter);
            (f.execute_filter)(filter);
            let error = self.last_error(device);
            (f.release_filter)(filter);
            (f.release_device)(device);
            error.map_or(Ok(output), |message| Err(DenoiseError::Failed(message)))
        }
    }

    fn error(&self, device: Handle) -> DenoiseError {
        DenoiseError::Failed(self.last_error(device).unwrap_or_else(|| "no reason given".into()))
    }

    /// The last error of a device, or of device creation if it is null.
    fn last_error(&self, device: Handle) -> Option<String> {
        let mut message: *const c_char = ptr::null();
        // SAFETY: the device lives or is null; a message that is set ends with a zero and is copied
        // at once.
        unsafe {
            match (self.functions.device_error)(device, &mut message) {
                ERROR_NONE => None,
                code if message.is_null() => Some(format!("error {code}")),
                _ => Some(CStr::from_ptr(message).to_string_lossy().into_owned()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_refused_with_the_way_to_install_it() {
        let message =
            Denoiser::load(Some(Path::new("nowhere"))).expect_err("nothing there").to_string();
        assert!(
            message.contains("not found in nowhere") && message.contains("pip install pyoidn"),
            "{message}"
        );
    }

    /// If Open Image Denoise is installed, noise is reduced and the mean is preserved.
    #[test]
    fn noise_goes_away_if_the_library_is_there() {
        let named = std::env::var_os("OIDN_DIR").map(std::path::PathBuf::from);
        let Ok(denoiser) = Denoiser::load(named.as_deref()) else {
            eprintln!(
                "skipped: Open Image Denoise is not installed (OIDN_DIR may name its folder)"
            );
            return;
        };
        let (width, height) = (64, 48);
        let noise = |i: usize| (i as u32).wrapping_mul(2_654_435_761) as f32 / u32::MAX as f32;
        let color: Vec<f32> = (0..width * height * 3).map(|i| noise(i / 3)).collect();
        let flat = |value: [f32; 3]| (0..width * height).flat_map(|_| value).collect::<Vec<f32>>();
        let (albedo, normal) = (flat([0.5; 3]), flat([0.0, 0.0, 1.0]));
        let noisy = Noisy { width, height, color: &color, albedo: &albedo, normal: &normal };
        let clean = denoiser.denoise(&noisy, 2).expect("it works");
        let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
        let spread =
            |v: &[f32]| v.iter().map(|x| (x - mean(v)).powi(2)).sum::<f32>() / v.len() as f32;
        assert!((mean(&clean) - mean(&color)).abs() < 0.05, "{} {}", mean(&clean), mean(&color));
        assert!(spread(&clean) < 0.1 * spread(&color), "{} {}", spread(&clean), spread(&color));
    }
}
