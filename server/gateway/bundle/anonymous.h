// The parts of a bug report without the names in them: a session, lines of the audit log, the configuration, what a gateway
// says of its rig. Measurements, settings, pictures and objects stay as they are.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <nlohmann/json.hpp>

#include "server/gateway/bundle/aliases.h"
#include "server/session/journal/journal.h"

namespace touchstone::gateway::bundle {

// All that a session of a journal has. A touch that is under way becomes one that failed, and says so.
absl::StatusOr<session::SessionContent> ReadContent(const session::Journal& journal,
                                                    const std::string& session, bool pictures);

// Session, ids, origin, calibration and errors; texts in the files of pictures.
void Anonymise(session::SessionContent* content, Aliases* aliases);
// "NOTE; ur3e at 192.168.0.10, end effector ... at ...", as a rig writes it: without the note.
std::string AnonymousProvenance(absl::string_view provenance, Aliases* aliases);
// A PNG file without what says when, where or by what it was made; what is no PNG file stays as it is.
std::string WithoutTexts(const std::string& png);

// The lines of an audit log that are about this session, and from its beginning to its end those that are about no session.
std::vector<nlohmann::ordered_json> LinesOf(const std::string& log, const session::SessionContent& content);
// Learns whom the lines name; before Anonymise, so that all texts agree.
void LearnFrom(const std::vector<nlohmann::ordered_json>& lines, Aliases* aliases);
void Anonymise(std::vector<nlohmann::ordered_json>* lines, Aliases* aliases);

// A gateway's TOML file. Numbers and switches stay, of texts only those that name no person, host or file. Learns the hosts.
absl::StatusOr<std::string> AnonymousConfig(const std::string& toml, const std::string& origin,
                                            Aliases* aliases);

// Texts of what a gateway said of itself (protocol messages as JSON).
void Anonymise(nlohmann::ordered_json* state, Aliases* aliases);

}  // namespace touchstone::gateway::bundle
