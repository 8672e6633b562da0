// Searches a built site as a browser does: `node tools/site/search.mjs build/docs [--stock] < queries`, a query a line.
// Prints a line of JSON for each: the names of the pages found, best first. --stock leaves our ranking out.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import vm from "node:vm";

const [site, ...flags] = process.argv.slice(2);
const window = { location: { search: "", href: "http://docs/search.html" } };
const document = { readyState: "complete", getElementById: () => null, addEventListener() {}, documentElement: { dataset: {} } };
const context = vm.createContext({
  window, document, console, URL, URLSearchParams, SPHINX_HIGHLIGHT_ENABLED: false,
  DOCUMENTATION_OPTIONS: {}, _ready: () => {}, _: (text) => text,
});
window.document = document;
const scripts = ["language_data.js", "searchtools.js"];
if (!flags.includes("--stock")) scripts.push("search-words.js", "search-ranking.js");
const sources = scripts.map((name) => readFileSync(`${site}/_static/${name}`, "utf8"));
sources.push(readFileSync(`${site}/searchindex.js`, "utf8"));
sources.push("const Stemmer = window.Stemmer; ");
// One script, as `const Search` is seen by all scripts of a page.
vm.runInContext(`var Stemmer;\n${sources[0]}\nStemmer = window.Stemmer;\n${sources.slice(1, -1).join("\n")}\nthis.Search = Search;`, context);
for await (const query of createInterface({ input: process.stdin })) {
  const found = context.Search._performSearch(...context.Search._parseQuery(query)).reverse();
  console.log(JSON.stringify([...new Set(found.map((each) => each[0]))]));
}
