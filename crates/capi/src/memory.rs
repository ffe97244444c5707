//! Memory of the caller, as slices.

use crate::error::{Failure, SnellError, null};
use std::mem::MaybeUninit;

/// The `count` values at `pointer`, which may be null if there are none.
///
/// # Safety
/// Unless it is null, `pointer` must point to so many initialised values, aligned as C aligns
/// them, which nobody changes during `'a`.
pub unsafe fn input<'a, T>(
    pointer: *const T,
    count: usize,
    name: &str,
) -> Result<&'a [T], Failure> {
    if fits::<T>(pointer.is_null(), count, name)? {
        // SAFETY: the pointer is not null, its values are the caller's promise, and the size fits.
        Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
    } else {
        Ok(&[])
    }
}

/// Room for `count` values at `pointer`; see [`input`].
///
/// # Safety
/// As for [`input`], but for the values: nobody else reads or writes them during `'a`.
pub unsafe fn output<'a, T>(
    pointer: *mut T,
    count: usize,
    name: &str,
) -> Result<&'a mut [MaybeUninit<T>], Failure> {
    if fits::<T>(pointer.is_null(), count, name)? {
        // SAFETY: as in `input`; the values are this call's alone, and need not be initialised.
        Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), count) })
    } else {
        Ok(&mut [])
    }
}

/// Whether there is anything at the pointer.
fn fits<T>(is_null: bool, count: usize, name: &str) -> Result<bool, Failure> {
    if count == 0 {
        return Ok(false);
    }
    if is_null {
        return Err(null(name));
    }
    if count > isize::MAX as usize / size_of::<T>() {
        let message = format!("{name}: {count} values do not fit the address space");
        return Err(Failure(SnellError::InvalidArgument, message));
    }
    Ok(true)
}

/// An empty vector with room for `count` values, or an error.
pub fn with_room<T>(count: usize) -> Result<Vec<T>, Failure> {
    let mut values = Vec::new();
    values
        .try_reserve_exact(count)
        .map_err(|_| Failure(SnellError::Limit, format!("not enough memory for {count} values")))?;
    Ok(values)
}
