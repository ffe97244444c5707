// A scene on the web: its file, and the files that it names.

/** A file with its path relative to the folder of all. */
export interface Fetched {
  path: string;
  bytes: Blob;
}

/** At most this many files are fetched for a scene, so many at a time. */
const MOST_FILES = 2000;
const AT_ONCE = 6;

const isRelative = (name: string): boolean => !/^([a-z][a-z0-9+.-]*:|\/)/i.test(name);

/** The words before names of files in lines of text, by the extension of the text. */
const NAMING: Record<string, string> = { obj: "mtllib", mtl: "map_\\w+|bump|norm|refl" };

async function get(address: string): Promise<Blob> {
  let response: Response;
  try {
    response = await fetch(address);
  } catch {
    throw new Error(
      `${address} cannot be fetched. If the address is right, its server does not allow other ` +
        "pages to read it (CORS): save the file and open it from your disk, or have the server " +
        "send the header “Access-Control-Allow-Origin: *”",
    );
  }
  if (response.ok) return response.blob();
  throw new Error(`${address}: the server answers ${response.status} ${response.statusText}`);
}

/** The names of files in the text of a scene, relative to it. */
async function named(name: string, file: Blob): Promise<string[]> {
  const extension = name.toLowerCase().split(".").at(-1);
  if (extension === "gltf") {
    type Listed = { uri?: string }[] | undefined;
    const { buffers, images } = JSON.parse(await file.text()) as {
      buffers: Listed;
      images: Listed;
    };
    const uris = [...(buffers ?? []), ...(images ?? [])].flatMap(({ uri }) => uri ?? []);
    return uris.map((uri) => (uri.startsWith("data:") ? uri : decodeURIComponent(uri)));
  }
  const words = NAMING[extension ?? ""];
  if (!words) return [];
  // The name of a picture comes last, after its options.
  const line = new RegExp(`^\\s*(?:${words})\\s+(.*\\S)\\s*$`, "gim");
  const found = [...(await file.text()).matchAll(line)].map((match) => match[1]!);
  const last = (text: string): string => text.split(/\s+/).at(-1)!.replaceAll("\\", "/");
  return found.map((text) => (extension === "obj" ? text : last(text)));
}

/** Fetches a scene and what it names. An error is a message for the user. */
export async function fetchScene(
  address: string,
  progress: (text: string) => void,
): Promise<Fetched[]> {
  const base = new URL(address, document.baseURI);
  const name = decodeURIComponent(base.pathname.split("/").at(-1)!) || "scene";
  progress(`fetching ${name}`);
  const first = { path: name, bytes: await get(base.href) };
  const files = new Map([[name, first]]);
  let fresh: Fetched[] = [first];
  while (fresh.length > 0) {
    const names = await Promise.all(
      fresh.map(({ path, bytes }) =>
        named(path, bytes).catch(() => {
          throw new Error(`${path}: this is no ${path.split(".").at(-1)} file`);
        }),
      ),
    );
    const wanted = [...new Set(names.flat())].filter(
      (path) => isRelative(path) && !files.has(path),
    );
    // What lies outside the folder of the scene cannot be told apart from it here.
    const outside = wanted.find((path) => path.split("/").includes(".."));
    if (outside) throw new Error(`${name} names ${outside}, which is not in its folder`);
    if (files.size + wanted.length > MOST_FILES)
      throw new Error(`${name} names more than ${MOST_FILES} files`);
    fresh = [];
    for (let i = 0; i < wanted.length; i += AT_ONCE) {
      progress(`fetching ${files.size} of ${files.size + wanted.length - i} files`);
      const some = wanted.slice(i, i + AT_ONCE).map(async (path) => {
        const escaped = path.split("/").map(encodeURIComponent).join("/");
        return { path, bytes: await get(new URL(escaped, base).href) };
      });
      const got = await Promise.all(some);
      for (const file of got) files.set(file.path, file);
      fresh.push(...got);
    }
  }
  return [...files.values()];
}
