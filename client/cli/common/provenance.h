// Who asked for a report, when and with what: the part of Report.provenance that a diagnosis, a pure function of its
// input, does not know.
#pragma once

#include <string>
#include <vector>

#include "server/source/object_store.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::cli {

// A word as a shell takes it: in single quotes where it has other characters than letters, digits and -_./,:=+@%.
std::string ShellWord(const std::string& word);

// A command as a shell takes it, its program by its name alone: words with other characters than letters, digits and -_./,:=+@% in single quotes.
std::string ShellCommand(int argc, const char* const* argv);

// Now, UTC: "2031-05-06T07:08:09Z".
std::string UtcNow();

// Puts the command, the date, the client's version and the mesh files' paths and hashes into the report, and the hash
// of the set's file unless it is empty. A mesh file that has gone meanwhile gets no hash.
void AddClientProvenance(const std::string& command, const std::string& set_sha256,
                         const std::vector<source::MeshSpec>& meshes, v1::Report* report);

}  // namespace touchstone::cli
