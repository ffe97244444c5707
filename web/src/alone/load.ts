// Loading the renderer, which the folder of the page holds compressed, so that no server has to
// compress it.

/** The share that has been loaded, from 0 to 1; not a number if it is not known. */
export type Progress = (share: number) => void;

/** All bytes of an answer, with what has come so far told meanwhile. */
async function bytesOf(response: Response, progress: Progress): Promise<Uint8Array<ArrayBuffer>> {
  const total = Number(response.headers.get("content-length") ?? NaN);
  const reader = response.body!.getReader();
  const parts: Uint8Array[] = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    length += value.length;
    progress(Math.min(1, length / total));
  }
  const all = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

/** The module of the renderer. */
export async function load(address: string, progress: Progress): Promise<ArrayBuffer> {
  const response = await fetch(address);
  if (!response.ok) throw new Error(`${address}: the server answers ${response.status}`);
  const bytes = await bytesOf(response, progress);
  // Some servers say that they have compressed it, and the browser has expanded it already.
  const isCompressed = bytes[0] === 0x1f && bytes[1] === 0x8b;
  if (!isCompressed) return bytes.buffer;
  const expanded = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(expanded).arrayBuffer();
}
