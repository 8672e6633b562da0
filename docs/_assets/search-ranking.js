/*
 * Ranks the results of the search box. Sphinx's own search demands that each word occurs on one page, and ranks all
 * matches in the text alike. This one ranks pages by how many words of the query they have, and where: in the title,
 * in the page's search words (`<!-- search: ... -->`), in a heading, or in the text. Evidence (measurements, decisions,
 * change log) is found only with the box below the results.
 */
"use strict";

(() => {
  const WEIGHTS = { title: 12, keyword: 11, heading: 5, text: 2 };
  const PREFIX = 0.5;
  const SYNONYM = 0.8;
  const SHELVES = [
    [/^docs\/(tutorials|how-to)\//, 1.15],
    [/^docs\/troubleshooting$/, 1.1],
    [/^docs\/reference\/api\//, 0.55],
    [/^docs\/reference\/contract$/, 0.4],
    [/^docs\/reference\/command-line$/, 0.7],
    [/^(README|CONTRIBUTING|SECURITY)$/, 0.5],
    [/^docs\/index$/, 0.4],
  ];
  const EVIDENCE = /^(docs\/evidence\/|benchmarks\/|CHANGELOG$)/;
  const SYNONYMS = [
    ["uav", "drone", "uas", "vehicle", "aircraft", "quadcopter", "copter"],
    ["several", "multiple", "many", "fleet", "swarm", "two"],
    ["boot", "autostart", "startup", "service", "systemd"],
    ["waypoint", "goto", "position"],
    ["refused", "denied", "rejected", "reject", "fails", "failed", "failure", "error"],
    ["transmitter", "rc", "remote", "radio"],
    ["companion", "onboard", "raspberry", "jetson"],
    ["install", "installation", "setup", "pip", "download"],
    ["tutorial", "start", "started", "beginner", "quickstart", "begin", "getting", "first"],
    ["log", "logs", "logging"],
    ["recording", "record", "bag", "rosbag"],
    ["battery", "power", "voltage"],
    ["gps", "satellite", "gnss"],
    ["fence", "geofence", "boundary"],
    ["connect", "connection", "connecting", "link"],
    ["picture", "photo", "image", "camera", "video"],
    ["simulation", "simulator", "sitl", "simulated"],
    ["speed", "velocity"],
    ["rtl", "return", "home"],
    ["stop", "kill", "emergency", "halt"],
    ["encryption", "tls", "ssl", "certificate"],
    ["authentication", "token", "password", "login"],
  ];

  const stem = (word) => new Stemmer().stemWord(word.toLowerCase());
  const stems = (text) => splitQuery(text.toLowerCase()).map(stem);
  const list = (files) => (files === undefined ? [] : files.length === undefined ? [files] : files);
  const get = (terms, word) => (Object.hasOwn(terms, word) ? list(terms[word]) : []);

  let synonyms = null;
  const alternatives = (word) => {
    if (synonyms === null) {
      synonyms = new Map();
      for (const group of SYNONYMS.map((each) => each.map(stem))) {
        for (const each of group) synonyms.set(each, [...(synonyms.get(each) ?? []), ...group]);
      }
    }
    return new Set((synonyms.get(word) ?? []).filter((each) => each !== word));
  };

  /** Scores of the files that have a word: Map of file to points. */
  const scoresOf = (index, keywords, word) => {
    const scores = new Map();
    const raise = (file, points) => scores.set(file, Math.max(points, scores.get(file) ?? 0));
    const exact = (term, factor) => {
      get(index.terms, term).forEach((file) => raise(file, WEIGHTS.text * factor));
      get(index.titleterms, term).forEach((file) => raise(file, WEIGHTS.heading * factor));
      index.titles.forEach((title, file) => stems(title).includes(term) && raise(file, WEIGHTS.title * factor));
      keywords.forEach((phrases, file) => phrases.some((each) => each.includes(term)) && raise(file, WEIGHTS.keyword * factor));
    };
    exact(word, 1);
    alternatives(word).forEach((each) => exact(each, SYNONYM));
    if (scores.size === 0 && word.length > 3) {
      for (const term of Object.keys(index.terms)) if (term.startsWith(word)) exact(term, PREFIX);
      for (const term of Object.keys(index.titleterms)) if (term.startsWith(word)) exact(term, PREFIX);
    }
    return scores;
  };

  const isVisible = (name, withEvidence) => withEvidence || !EVIDENCE.test(name);

  const perform = (query, searchTerms, excludedTerms, objectTerms, withEvidence) => {
    const index = Search._index;
    const names = index.docnames;
    const keywords = names.map((name) => (window.UAL_SEARCH_WORDS?.[name] ?? []).map(stems));
    const words = searchTerms.size ? [...searchTerms] : stems(query);
    const phrase = stems(query).join(" ");
    const total = new Map();
    for (const word of words) {
      const found = scoresOf(index, keywords, word);
      const rarity = Math.log(1 + names.length / (found.size || 1));
      for (const [file, points] of found) {
        const sum = total.get(file) ?? { points: 0, words: 0 };
        total.set(file, { points: sum.points + points * rarity, words: sum.words + 1 });
      }
    }
    const results = [];
    for (const [file, { points, words: count }] of total) {
      const name = names[file];
      if (!isVisible(name, withEvidence)) continue;
      if ([...excludedTerms].some((term) => get(index.terms, term).includes(file))) continue;
      let score = points * (count / words.length) ** 2;
      if (keywords[file].some((each) => each.join(" ") === phrase)) score += 60;
      if (stems(index.titles[file]).join(" ") === phrase) score += 60;
      score *= SHELVES.find(([shelf]) => shelf.test(name))?.[1] ?? 1;
      const heading = Object.entries(index.alltitles).flatMap(([title, places]) =>
        places.filter(([in_, id]) => in_ === file && id !== null && words.every((word) => stems(title).includes(word)))
          .map(([, id]) => "#" + id))[0] ?? "";
      results.push([name, index.titles[file], heading, null, score, index.filenames[file], SearchResultKind.text]);
    }
    const isName = /[._]/.test(query);
    for (const term of objectTerms) {
      for (const each of Search.performObjectSearch(term, objectTerms)) {
        if (isVisible(each[0], withEvidence)) results.push([...each.slice(0, 4), isName ? 100 + each[4] : 1, ...each.slice(5)]);
      }
    }
    const seen = new Set();
    return results
      .sort((a, b) => a[4] - b[4] || (a[1] < b[1] ? 1 : -1)) // the last is displayed first
      .reverse()
      .filter((each) => !seen.has(each[0] + each[2]) && seen.add(each[0] + each[2]))
      .reverse();
  };

  const offerEvidence = (withEvidence) => {
    const results = document.getElementById("search-results");
    if (!results || document.getElementById("search-evidence")) return;
    const url = new URL(window.location.href);
    withEvidence ? url.searchParams.delete("evidence") : url.searchParams.set("evidence", "1");
    const link = document.createElement("a");
    link.id = "search-evidence";
    link.href = url.href;
    link.textContent = withEvidence
      ? "Leave out measurements, decisions and the change log"
      : "Search measurements, decisions and the change log, too";
    results.after(link);
  };

  const install = () => {
    if (typeof Search === "undefined") return;
    Search._performSearch = (query, searchTerms, excludedTerms, _highlightTerms, objectTerms) => {
      const withEvidence = new URLSearchParams(window.location.search).has("evidence");
      offerEvidence(withEvidence);
      return perform(query, searchTerms, excludedTerms, objectTerms, withEvidence);
    };
  };

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", install);
  else install();
})();
