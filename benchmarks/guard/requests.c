/* Client requests of callgrind, called from Python by ctypes; a machine without valgrind executes them as no-ops. */
#include <valgrind/callgrind.h>

void begin(void) { CALLGRIND_START_INSTRUMENTATION; }

/* Ends a count, and begins the next one. CALLGRIND_ZERO_STATS instead led to negative totals. */
void dump(const char *name) { CALLGRIND_DUMP_STATS_AT(name); }
