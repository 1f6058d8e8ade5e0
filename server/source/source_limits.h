// The most that one request may ask a source for; beyond it, RESOURCE_EXHAUSTED.
#pragma once

namespace touchstone::source {

struct SourceLimits {
  int max_touches_per_request = 20000;
  int max_images_per_request = 1000;
  int max_batch_size = 65536;
  int max_indices_per_request = 100000;
};

}  // namespace touchstone::source
