// Files and folders that are dropped on the page.

import { isLight, isPicture, lightBy, type Named, openFiles } from "./send";
import type { Store } from "./store";

/** More files than this are no scene. */
const MOST_FILES = 10_000;

/** The file of an entry. */
const fileOf = (entry: FileSystemFileEntry): Promise<File> =>
  new Promise((resolve, reject) => entry.file(resolve, reject));

/** All entries of a folder; the browser gives some at a time. */
async function entriesOf(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) =>
      reader.readEntries(resolve, reject),
    );
    if (some.length === 0) return all;
    all.push(...some);
  }
}

/** The files in these entries and all folders below, without those that systems hide. */
async function filesIn(entries: FileSystemEntry[]): Promise<Named[]> {
  const [files, open] = [[] as Named[], [...entries]];
  while (open.length > 0 && files.length <= MOST_FILES) {
    const entry = open.shift()!;
    if (entry.name.startsWith(".") || entry.name === "__MACOSX") continue;
    if (entry.isDirectory) open.push(...(await entriesOf(entry as FileSystemDirectoryEntry)));
    else {
      const file = await fileOf(entry as FileSystemFileEntry);
      files.push({ path: entry.fullPath.replace(/^\//, ""), file });
    }
  }
  return files;
}

/** The files of a drop. What the browser gives is read at once: it is gone after the event. */
export function filesOf(data: DataTransfer): Promise<Named[]> {
  const plain = [...data.files].map((file) => ({ path: file.name, file }));
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.() ?? null);
  const known = entries.filter((entry) => entry !== null);
  return known.some((entry) => entry.isDirectory) ? filesIn(known) : Promise.resolve(plain);
}

/** Opens what was dropped: a scene with its files, or a picture that lights the scene. */
export async function take(store: Store, data: DataTransfer): Promise<void> {
  const files = await filesOf(data).catch(() => null);
  if (files === null) {
    store.notice("the browser could not read what was dropped");
    return;
  }
  if (files.length > MOST_FILES) {
    store.notice(`more than ${MOST_FILES} files: drop only those of one scene`);
    return;
  }
  const [first] = files;
  if (files.length === 1 && isLight(first!.file.name)) await lightBy(store, first!.file);
  else if (files.length > 1 && files.every(({ file }) => isPicture(file.name)))
    store.notice(
      `${files.length} pictures at once are too many: drop one of them. One with ` +
        "light (hdr, exr) lights the scene; any is a texture where it is dropped on a parameter " +
        "of a material",
    );
  else if (files.length > 0 && files.every(({ file }) => isPicture(file.name)))
    store.notice(
      "a picture is dropped on a parameter of a material, as its texture, or on Surroundings, " +
        "to light the scene",
    );
  else await openFiles(store, files);
}
