#include "server/base/version.h"

namespace touchstone {

const char* const kVersion = TOUCHSTONE_VERSION;

}  // namespace touchstone
