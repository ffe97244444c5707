// Unpacks pictures at rest: 16-bit floats as crates/viewer/src/halves.rs compresses them.

async function inflate(bytes: ArrayBuffer): Promise<Uint8Array> {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The bits of the values of one channel, from their differences to what the neighbours tell. */
function channel(bytes: Uint8Array, width: number, height: number): Uint16Array {
  const count = width * height;
  const values = new Uint16Array(count);
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i++) {
      const folded = bytes[i] | (bytes[count + i] << 8);
      const difference = (folded >> 1) ^ -(folded & 1);
      let guess = 0;
      if (y === 0) guess = x === 0 ? 0 : values[i - 1];
      else if (x === 0) guess = values[i - width];
      else {
        const left = values[i - 1];
        // The mean of two 16-bit numbers that may be on both sides of zero.
        guess = left + (((values[i - width] - left) << 16) >> 17);
      }
      values[i] = guess + difference;
    }
  }
  return values;
}

/** The bits of red, green and blue of every pixel. */
export async function unpackHalves(
  bytes: ArrayBuffer,
  [width, height]: [number, number],
): Promise<Uint16Array> {
  const all = await inflate(bytes);
  const count = width * height;
  if (all.length !== count * 6) throw new Error("the picture is not complete");
  const [red, green, blue] = [0, 1, 2].map((c) =>
    channel(all.subarray(c * 2 * count, (c + 1) * 2 * count), width, height),
  );
  const halves = new Uint16Array(3 * count);
  for (let i = 0, a = 0; i < count; i++, a += 3) {
    halves[a] = red[i] + green[i];
    halves[a + 1] = green[i];
    halves[a + 2] = blue[i] + green[i];
  }
  return halves;
}
