//! Embree's device: build threads, version and memory in use.

use crate::abi::{self, Handle};
use crate::library::{Embree, LoadError};
use std::ffi::{CString, c_void};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

/// A device that builds scenes.
#[derive(Debug)]
pub struct Device {
    pub(crate) embree: Arc<Embree>,
    pub(crate) handle: Handle,
    /// The number of bytes in use. Boxed, because Embree keeps a pointer to it.
    memory: Box<AtomicI64>,
}

// SAFETY: Embree's API reference says that all calls on a device are thread-safe, except for those
// that change one geometry or scene.
unsafe impl Send for Device {}
// SAFETY: all calls on a device are thread-safe, except for those that change one geometry or
// scene.
unsafe impl Sync for Device {}

/// The function that Embree calls for every allocation and release.
unsafe extern "C" fn count_memory(counter: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: the pointer is the one that was given to Embree with this function; the device keeps
    // the counter alive.
    let counter = unsafe { &*counter.cast::<AtomicI64>() };
    counter.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

impl Device {
    /// A device with this many build threads. If several devices exist, all build with the maximum.
    pub fn new(embree: &Arc<Embree>, threads: usize) -> Result<Arc<Self>, LoadError> {
        let config = CString::new(format!("threads={threads}")).expect("no zero byte in it");
        let functions = &embree.functions;
        // SAFETY: the argument is a string that ends with a zero byte.
        let handle = unsafe { (functions.new_device)(config.as_ptr()) };
        if handle.is_null() {
            // SAFETY: a null device requests the error of device creation.
            return Err(LoadError::Device(unsafe { (functions.device_error)(handle) }));
        }
        let memory = Box::new(AtomicI64::new(0));
        let counter = std::ptr::from_ref(&*memory).cast_mut().cast();
        // SAFETY: the counter is in a separate box, which is dropped after the device is released.
        unsafe { (functions.set_memory_monitor)(handle, count_memory, counter) };
        Ok(Arc::new(Self { embree: embree.clone(), handle, memory }))
    }

    /// Embree's version, such as `4.4.0`.
    pub fn version(&self) -> String {
        let parts = [
            abi::DEVICE_PROPERTY_VERSION_MAJOR,
            abi::DEVICE_PROPERTY_VERSION_MINOR,
            abi::DEVICE_PROPERTY_VERSION_PATCH,
        ];
        let number = |property| {
            // SAFETY: the device is alive and these are properties that every device has.
            unsafe { (self.embree.functions.device_property)(self.handle, property) }.to_string()
        };
        parts.map(number).join(".")
    }

    /// Bytes that Embree has allocated and not released: acceleration structures and copies of
    /// meshes.
    pub fn memory_bytes(&self) -> i64 {
        self.memory.load(Ordering::Relaxed)
    }

    /// The number of the first error since the last call; 0 if there was none.
    pub(crate) fn take_error(&self) -> i32 {
        // SAFETY: the device is alive.
        unsafe { (self.embree.functions.device_error)(self.handle) }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: made by this library and released once. Scenes hold the device, so they are gone.
        unsafe { (self.embree.functions.release_device)(self.handle) };
    }
}
