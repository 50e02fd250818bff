import { defineConfig } from "vite";

const service = "http://127.0.0.1:8000";

export default defineConfig({
  build: {
    outDir: "../static",
    emptyOutDir: true,
    target: "es2022",
    sourcemap: false,
    // The map library is most of the page; the warning would only repeat that.
    chunkSizeWarningLimit: 1500,
  },
  server: { proxy: { "/api": { target: service, ws: true } } },
});
