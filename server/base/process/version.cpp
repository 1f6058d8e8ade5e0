#include "server/base/process/version.h"

namespace touchstone {

const char* const kVersion = TOUCHSTONE_VERSION;

}  // namespace touchstone
