// bundle.cjs FOLDER: the scripts of the pages, minified, each in a folder of its own there, out of
// FOLDER's node_modules.
const { copyFile, mkdir, readFile } = require("node:fs/promises");
const path = require("node:path");

const into = path.resolve(process.argv[2]);
const packages = path.join(into, "node_modules");
const { build } = require(path.join(packages, "esbuild"));

// A module may import a .wasm file as if it were one; bundlers leave to a plugin what that means.
const wasm = (folder) => ({
  name: "wasm",
  setup(build) {
    build.onLoad({ filter: /\.wasm$/ }, async (args) => {
      const module = await WebAssembly.compile(await readFile(args.path));
      const exported = WebAssembly.Module.exports(module).map(({ name }) => name);
      const imported = [...new Set(WebAssembly.Module.imports(module).map(({ module }) => module))];
      const file = path.basename(args.path);
      await mkdir(folder, { recursive: true });
      await copyFile(args.path, path.join(folder, file));
      return {
        resolveDir: path.dirname(args.path),
        contents: `
          ${imported.map((from, i) => `import * as imported${i} from "${from}";`).join("\n")}
          const imports = { ${imported.map((from, i) => `"${from}": imported${i}`).join(", ")} };
          const file = fetch(new URL("${file}", import.meta.url));
          const { instance } = await WebAssembly.instantiateStreaming(file, imports);
          export const { ${exported.join(", ")} } = instance.exports;`,
      };
    });
  },
});

async function bundle(peer) {
  const folder = path.join(into, peer);
  await build({
    entryPoints: [path.join(__dirname, peer, "page.js")],
    outdir: folder,
    nodePaths: [packages],
    bundle: true,
    minify: true,
    format: "esm",
    plugins: [wasm(folder)],
    logLevel: "warning",
  });
}

Promise.all(["rosbridge_rs", "rosbridge_map", "zenoh_ts"].map(bundle)).catch(() => process.exit(1));
