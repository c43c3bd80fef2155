import js from "@eslint/js";
import globals from "globals";

// the pages load plain scripts one after the other, each of which defines one of these names for the later ones
const ours = [
  ...["Format", "LiveEngine", "OfflineEngine", "Controls", "SectionDrawing", "SectionView"],
  ...["SensorView", "ArrayView", "Measured", "Numbers", "Exports", "Requests", "Explorer", "Tip", "Figures"],
  ...["ReportSurface", "Theme"],
];
const libraries = ["THREE", "vegaEmbed"];

export default [
  { ignores: ["**/vendor/", "out/", "results/", ".venv/"] },
  {
    files: ["studies/**/*.js"],
    ...js.configs.recommended,
    languageOptions: {
      sourceType: "script",
      ecmaVersion: 2024,
      globals: {
        ...globals.browser,
        ...Object.fromEntries([...ours, ...libraries].map((name) => [name, "readonly"])),
      },
    },
    rules: {
      ...js.configs.recommended.rules,
      eqeqeq: "error",
      "one-var": ["error", "never"],
      "no-var": "error",
      "prefer-const": ["error", { destructuring: "all" }],
      "no-redeclare": ["error", { builtinGlobals: false }],
      "no-unused-vars": ["error", { vars: "local" }],
      "max-len": ["error", { code: 120, ignoreUrls: true }],
    },
  },
];
