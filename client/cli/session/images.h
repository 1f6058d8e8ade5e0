// Sessions of photographs: a folder or an HDF5 file (server/session/measurement_files.md) sent to a server, and written again.
#pragma once

#include <string>

#include <absl/status/status.h>

#include "client/cli/common/common.h"
#include "client/source/connection/connection.h"
#include "server/service/sessions/stored_session.h"

namespace touchstone::cli {

bool IsHdf5Path(const std::string& path);  // it ends in .h5 or .hdf5

// The folder of an image set, or the HDF5 file of one, with its touches if it has some.
absl::StatusOr<service::StoredSession> ReadImageSession(const std::string& path);

// A server knows what it is sent by the session's name alone: "monday:5: ..." becomes "set.csv:5: ...".
absl::Status WithFile(const absl::Status& status, const std::string& session, const std::string& path);

// Sends a measurement file or an image set, with its touches if it has some. `check`: it is not stored.
absl::StatusOr<v1::Session> SendSession(client::Connection* connection, const std::string& path,
                                        const std::string& name, bool check);

// What the server keeps under a name. `left_out`: what of it is not among that, in words; empty: nothing.
absl::StatusOr<service::StoredSession> FetchSession(client::Connection* connection, const std::string& name,
                                                    std::string* left_out);

// Writes a session called `name` as --output says: photographs, and the touches if there are some, as the folder of an
// image set, or as one file (.h5); touches alone, or where a .csv or stdout was asked for, as a measurement file, and then says that the
// photographs are not in it. An error if nothing would be left.
absl::Status WriteExportedSession(const Cli& cli, const std::string& name,
                                  const service::StoredSession& session, const std::string& output);

}  // namespace touchstone::cli
