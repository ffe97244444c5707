// Where the scene that is shown came from.

import { signal } from "@preact/signals";

/** The name of a built-in scene or the address of a file; `null` for files of the user. */
export const origin = signal<string | null>(null);

/** The address from which the files came that are about to be opened. */
let coming: string | null = null;

/** Does something that opens files from an address. */
export async function from<T>(address: string, act: () => Promise<T>): Promise<T> {
  coming = address;
  try {
    return await act();
  } finally {
    coming = null;
  }
}

/** Notes that a request to open something has been answered. */
export function opened(builtin: string | null): void {
  origin.value = builtin ?? coming;
}
