/// <reference types="node" />
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { defineConfig, type Plugin } from "vite";

const service = "http://127.0.0.1:8000";
const outDir = "../static";

/** Writes a compressed copy beside every asset, which the service sends to browsers that take it. */
function compressed(): Plugin {
  return {
    name: "compressed",
    apply: "build",
    closeBundle() {
      const folder = join(import.meta.dirname, outDir, "assets");
      for (const name of readdirSync(folder)) {
        if (/\.(m?js|css|svg|json|tsv)$/.test(name)) {
          writeFileSync(join(folder, `${name}.gz`), gzipSync(readFileSync(join(folder, name)), { level: 9 }));
        }
      }
    },
  };
}

/** Has browsers ask for what is shown first before anything else, and fetch the map's code together with the page's own. */
function preloaded(): Plugin {
  return {
    name: "preloaded",
    apply: "build",
    transformIndexHtml(_, { bundle = {} }) {
      const chunks = Object.values(bundle).filter((part) => part.type === "chunk");
      const chart = chunks.find((chunk) => chunk.name === "chart");
      const early = chunks.find((chunk) => chunk.name === "early");
      if (!chart || !early)
        throw new Error("the map's code, or what asks first, is no part of its own any more");
      const needed = [chart, ...chunks.filter((c) => chart.imports.includes(c.fileName) && !c.isEntry)];
      const styles = needed.flatMap((chunk) => [...(chunk.viteMetadata?.importedCss ?? [])]);
      const link = (attrs: Record<string, string>) => ({
        tag: "link",
        attrs: { crossorigin: "", ...attrs },
        injectTo: "head" as const,
      });
      return [
        {
          tag: "script",
          attrs: {
            type: "module",
            async: true,
            fetchpriority: "high",
            crossorigin: "",
            src: `/${early.fileName}`,
          },
          injectTo: "head-prepend" as const,
        },
        // Only fetched: a module that is preloaded as one is compiled before the page's own code runs.
        ...needed.map((chunk) => link({ rel: "preload", as: "script", href: `/${chunk.fileName}` })),
        ...styles.map((name) => link({ rel: "preload", as: "style", href: `/${name}` })),
      ];
    },
  };
}

export default defineConfig({
  plugins: [preloaded(), compressed()],
  build: {
    outDir,
    emptyOutDir: true,
    target: "es2022",
    sourcemap: false,
    rolldownOptions: { input: { index: "index.html", early: "src/api/early.ts" } },
    // The map library is most of the page; the warning would only repeat that.
    chunkSizeWarningLimit: 1500,
  },
  worker: { format: "es" },
  server: { proxy: { "/api": { target: service, ws: true } } },
});
