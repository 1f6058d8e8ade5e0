// Why a connection failed where TCP works: gRPC says "no connection", which tells nobody that a certificate has expired.
#pragma once

#include <string>

#include "client/source/connection/credentials.h"

namespace touchstone::client {

// Connects anew and shakes hands. In words what is wrong between a server and these credentials and what would be right;
// empty if nothing is found, or nobody listens. Takes some seconds at most.
std::string ExplainTlsFailure(const std::string& address, const Credentials& credentials);

}  // namespace touchstone::client
