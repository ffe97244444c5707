import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { defineConfig, type Plugin } from "vite";

const PROGRAM = "snell.wasm.gz";
const GALLERY = "../crates/viewer/gallery";

// The renderer that `cargo xtask page` has built. It is compressed here, so that every server may
// send it as it is.
const program = gzipSync(readFileSync(process.env.SNELL_WASM!), { level: 9 });
const version = createHash("sha256").update(program).digest("hex").slice(0, 12);

/** Puts the renderer and the pictures of scenes into the folder. */
const files: Plugin = {
  name: "snell-files",
  generateBundle() {
    this.emitFile({ type: "asset", fileName: PROGRAM, source: program });
    for (const name of readdirSync(GALLERY)) {
      const source = readFileSync(join(GALLERY, name));
      this.emitFile({ type: "asset", fileName: `gallery/${name}`, source });
    }
  },
};

// A folder that any server of files can serve, below any address.
export default defineConfig({
  root: "alone",
  base: "./",
  define: { __PROGRAM__: JSON.stringify(`${PROGRAM}?${version}`) },
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  plugins: [files],
  worker: { format: "es" },
  build: { outDir: "../../target/page", emptyOutDir: true, modulePreload: false },
});
