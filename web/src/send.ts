// Sending files to the server: scenes and pictures.

import { host } from "./host";
import type { Store } from "./store";

/** At most this many bytes in one request. */
const MOST = 256 << 20;

/** A file with its path in what was dropped. */
export interface Named {
  path: string;
  file: File;
}

const EXTENSION = /\.([^./]+)$/;
const extension = (name: string): string => EXTENSION.exec(name.toLowerCase())?.[1] ?? "";

/** Pictures with light rather than colours: environments. */
export const isLight = (name: string): boolean => ["hdr", "exr", "pfm"].includes(extension(name));

/** Pictures of all kinds. */
export const isPicture = (name: string): boolean =>
  isLight(name) ||
  ["png", "jpg", "jpeg", "webp", "tga", "bmp", "tif", "tiff", "gif", "ktx2", "dds"].includes(
    extension(name),
  );

/** Says that files are too large to send; true if they are. */
function isTooLarge(store: Store, bytes: number): boolean {
  if (bytes <= MOST) return false;
  const [size, most] = [bytes, MOST].map((b) => Math.ceil(b / (1 << 20)));
  store.notice(
    `${size} MB are too much to send, ${most} MB at most: start the viewer with the file, ` +
      "which is then read where it is",
  );
  return true;
}

/** Opens the scene among files. If it cannot be read, the scene that is shown stays: false. */
export async function openFiles(store: Store, files: Named[]): Promise<boolean> {
  if (files.length === 0) return false;
  const bytes = files.reduce((sum, { file }) => sum + file.size, 0);
  if (isTooLarge(store, bytes)) return false;
  const [first] = files;
  if (files.length === 1)
    return store.open(`name=${encodeURIComponent(first!.file.name)}`, first!.file);
  const list = files.map(({ path, file }) => ({ name: path, bytes: file.size }));
  const body = new Blob([`${JSON.stringify(list)}\n`, ...files.map(({ file }) => file)]);
  return store.open("files", body);
}

/** Sends a picture for changes of the scene; its name there, or null after a notice. */
export async function sendPicture(store: Store, file: File): Promise<string | null> {
  if (isTooLarge(store, file.size)) return null;
  const query = `picture?name=${encodeURIComponent(file.name)}`;
  const response = await host.ask(query, { method: "POST", body: file });
  const text = (await response.text()).trim();
  if (response.ok) return text;
  store.notice(text);
  return null;
}

/** Lights the scene by a picture, which is seen behind it. */
export async function lightBy(store: Store, file: File): Promise<void> {
  const name = await sendPicture(store, file);
  if (name === null) return;
  store.edits([
    ["environment", name],
    ["background", "environment"],
  ]);
}
