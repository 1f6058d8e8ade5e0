// Sessions of photographs: a folder (server/session/measurement_files.md) sent to a server, and written again.
#pragma once

#include <string>

#include <absl/status/status.h>

#include "client/source/connection.h"
#include "server/service/stored_session.h"

namespace touchstone::cli {

// Sends a measurement file or the folder of an image set, with its touches.csv if it has one. `check`: it is not stored.
absl::StatusOr<v1::Session> SendSession(client::Connection* connection, const std::string& path,
                                        const std::string& name, bool check);

// What the server keeps under a name.
absl::StatusOr<service::StoredSession> FetchSession(client::Connection* connection, const std::string& name);

// Writes the photographs, and the touches if there are some, into a folder without an image set.
absl::Status WriteSessionFolder(const service::StoredSession& session, const std::string& folder);

}  // namespace touchstone::cli
