window.UAL_SEARCH_WORDS = {};
