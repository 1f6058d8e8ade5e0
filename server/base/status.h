// Errors are absl::Status values: what failed, on which input, what would be right.
// Logged or returned, never both. The canonical code is the one that goes on the wire.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#define TOUCHSTONE_CONCAT_INNER_(a, b) a##b
#define TOUCHSTONE_CONCAT_(a, b) TOUCHSTONE_CONCAT_INNER_(a, b)

// Returns from the calling function if `expression` is an error.
#define TOUCHSTONE_RETURN_IF_ERROR(expression)                                                               \
  do {                                                                                                       \
    if (absl::Status touchstone_status_ = (expression); !touchstone_status_.ok()) return touchstone_status_; \
  } while (false)

// TOUCHSTONE_ASSIGN_OR_RETURN(Mesh mesh, ReadMesh(path)): assigns the value, or returns the error.
#define TOUCHSTONE_ASSIGN_OR_RETURN(declaration, expression) \
  TOUCHSTONE_ASSIGN_OR_RETURN_INNER_(TOUCHSTONE_CONCAT_(touchstone_or_, __LINE__), declaration, expression)
#define TOUCHSTONE_ASSIGN_OR_RETURN_INNER_(variable, declaration, expression) \
  auto variable = (expression);                                               \
  if (!variable.ok()) return variable.status();                               \
  declaration = *std::move(variable)
