import { createHash } from "node:crypto";
import { defineConfig, type Plugin } from "vite";

// One file: script and style inside, allowed by their hashes alone; the data's place is marked for the program that fills it.
function onePage(): Plugin {
  const hash = (text: string) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
  return {
    name: "one-page",
    enforce: "post",
    generateBundle(_options, bundle) {
      let script = "";
      let style = "";
      for (const [name, file] of Object.entries(bundle)) {
        if (file.type === "chunk") script += file.code;
        else if (name.endsWith(".css")) style += file.source;
        delete bundle[name];
      }
      // Neither may end its element.
      script = script.replace(/<\/(script)/gi, "<\\/$1").replace(/<!--/g, "<\\!--").trim();
      style = style.trim();
      const policy = `default-src 'none'; script-src ${hash(script)}; style-src ${hash(style)}; img-src data: blob:; base-uri 'none'; form-action 'none'`;
      const page = `<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="${policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Touchstone report</title>
<style>${style}</style>
</head>
<body>
<div id="page"><noscript>This report is drawn by a script inside the file; allow scripts to see it. touchstone diagnose --json writes the same numbers.</noscript></div>
<script type="application/json" id="touchstone-data">@TOUCHSTONE_DATA@</script>
<script>${script}</script>
</body>
</html>
`;
      this.emitFile({ type: "asset", fileName: "page.html", source: page });
    },
  };
}

export default defineConfig({
  plugins: [onePage()],
  build: {
    outDir: process.env.TOUCHSTONE_PAGE_OUT ?? "dist",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    cssCodeSplit: false,
    assetsInlineLimit: 0,
    rollupOptions: { output: { format: "iife", inlineDynamicImports: true } },
  },
});
