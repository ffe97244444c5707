// Saving the picture, and the command that renders it.

import { busy, numbers, type Store, scene, view } from "./store";

/** Saves the picture that is shown; while it moves, the one at rest, as soon as it is there. */
export async function save(store: Store, format: string): Promise<void> {
  busy.value = "saving the picture";
  await store.heard();
  const response = await store.ask(`save?format=${format}`);
  busy.value = "";
  if (!response) return;
  if (!response.ok) {
    store.notice((await response.text()).trim());
    return;
  }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = `${scene.value?.name.replace(/[^A-Za-z0-9]/g, "-") || "picture"}.${format}`;
  link.click();
  URL.revokeObjectURL(link.href);
  const { samples, wanted } = numbers.value;
  if (samples < wanted) {
    store.notice(`Saved with the ${samples} of ${wanted} samples so far`);
  }
}

export async function copyCommand(store: Store): Promise<void> {
  // The server tells the command when the view rests.
  await store.rested();
  await copyText(store, view.value?.command ?? "");
}

/** Copies a text, or shows it where that is not allowed. */
export async function copyText(store: Store, text: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    store.notice(`Copied: ${text}`);
  } catch {
    store.notice(text);
  }
}
