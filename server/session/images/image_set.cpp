#include "server/session/images/image_set.h"

namespace touchstone::session {

std::vector<float> ImageSet::Grey(size_t photograph) const {
  const PhotographRow& row = photographs[photograph];
  if (row.channels == 1) return {row.pixels.begin(), row.pixels.end()};
  std::vector<float> grey(row.pixels.size() / 3);
  for (size_t k = 0; k < grey.size(); ++k) {
    const uint8_t* rgb = &row.pixels[3 * k];
    grey[k] = static_cast<float>(rgb[0] + rgb[1] + rgb[2]) / 3.0f;
  }
  return grey;
}

}  // namespace touchstone::session
