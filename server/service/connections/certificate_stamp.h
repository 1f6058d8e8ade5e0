// How gRPC learns of a client's certificate where TLS ends before it (tls_port.h): every call of such a connection gets a header
// with the names, whose own name nobody outside of this process knows.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/strings/string_view.h>

#include "server/service/connections/wire.h"

namespace touchstone::service {

// The name of the header, another one in each process.
const std::string& StampName();
std::string StampOf(const std::vector<std::string>& certificate_names);
// Empty where it is no stamp.
std::vector<std::string> NamesOfStamp(absl::string_view stamp);

// The wire with the stamp on every call that it reads, if its client has a certificate.
std::unique_ptr<Wire> Stamped(std::unique_ptr<Wire> wire);

}  // namespace touchstone::service
