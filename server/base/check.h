// Checks for our own bugs: a violated invariant ends the process with its text and place.
// Never used on input; input errors are statuses.
#pragma once

#include <cstdio>
#include <cstdlib>

#define TOUCHSTONE_CHECK(condition)                                                               \
  do {                                                                                            \
    if (!(condition)) {                                                                           \
      std::fprintf(stderr, "%s:%d: internal check failed: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                               \
    }                                                                                             \
  } while (false)
