#include "server/gateway/bundle/replay.h"

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <google/protobuf/util/json_util.h>

#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/gateway/bundle/bundle_names.h"

namespace touchstone::gateway::bundle {
namespace {

constexpr uint64_t kMaxAuditBytes = 256 << 20;
constexpr uint64_t kMaxStateBytes = 4 << 20;

absl::Status Unreadable(const Replay& replay, const char* member, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(replay.name, ": ", member, ": ", Printable(why, 200)));
}

// The text of a field; empty where there is none.
std::string TextOf(const nlohmann::json& object, const char* field) {
  const auto found = object.find(field);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

absl::Status ReadFaults(Replay* replay) {
  if (!replay->bundle->Has(kBundleAudit)) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string log,
                              ReadFile(replay->bundle->PathOf(kBundleAudit), kMaxAuditBytes));
  for (const absl::string_view text : absl::StrSplit(log, '\n', absl::SkipEmpty())) {
    const nlohmann::json line = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
    if (!line.is_object()) return Unreadable(*replay, kBundleAudit, "a line is no JSON object");
    const std::string event = TextOf(line, "event");
    if (event != "touch_failed" && event != "touch_refused") continue;
    // Older gateways wrote no code.
    absl::StatusCode code = absl::StatusCode::kUnknown;
    const std::string name = TextOf(line, "code");
    for (int number = 1; number <= 16; ++number)
      if (absl::StatusCodeToString(static_cast<absl::StatusCode>(number)) == name)
        code = static_cast<absl::StatusCode>(number);
    replay->faults[TextOf(line, "id")].emplace_back(code, Printable(TextOf(line, "why"), 4096));
  }
  return absl::OkStatus();
}

absl::Status ReadMeshes(Replay* replay) {
  const nlohmann::json meshes = replay->bundle->manifest().value("meshes", nlohmann::json::array());
  if (!meshes.is_array()) return Unreadable(*replay, "manifest.json", "'meshes' is no list");
  for (const nlohmann::json& given : meshes) {
    source::MeshSpec mesh;
    if (!given.is_object()) return Unreadable(*replay, "manifest.json", "a mesh is no object");
    mesh.name = TextOf(given, "object");
    const std::string file = TextOf(given, "file");
    if (!replay->bundle->Has(file))
      return Unreadable(*replay, "manifest.json", absl::StrCat("the mesh '", file, "' is not in it"));
    mesh.path = replay->bundle->PathOf(file);
    const std::string text = TextOf(given, "options");
    const std::vector<std::string> options = absl::StrSplit(text, ',', absl::SkipEmpty());
    for (const std::string& option : options) {
      const std::vector<std::string> parts = absl::StrSplit(option, absl::MaxSplits('=', 1));
      const bool taken =
          parts.size() == 2 && ((parts[0] == "unit" && !(mesh.unit = parts[1]).empty()) ||
                                (parts[0] == "up" && !(mesh.up = parts[1]).empty()) ||
                                (parts[0] == "scale" && absl::SimpleAtod(parts[1], &mesh.scale)) ||
                                (parts[0] == "fit_mm" && absl::SimpleAtod(parts[1], &mesh.fit_mm)));
      if (!taken) return Unreadable(*replay, "manifest.json", absl::StrCat("the mesh option '", option, "'"));
    }
    replay->meshes.push_back(std::move(mesh));
  }
  return absl::OkStatus();
}

// What the session itself says, where nobody asked the gateway.
absl::Status DescribeFromSession(Replay* replay) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal,
                              session::Journal::Open(replay->journal, session::Journal::Mode::kReadOnly));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<session::JournalSession> sessions, journal->Sessions());
  if (sessions.size() != 1) return Unreadable(*replay, kBundleJournal, "a bundle has one session");
  const session::JournalSession& session = sessions[0];
  v1::RigState& rig = replay->rig;
  rig.set_provenance(session.provenance);
  rig.set_calibration(session.calibration);
  rig.set_fingers(static_cast<uint32_t>(session.fingers));
  rig.set_spacing_m(session.spacing_m);
  rig.set_time_scale(1);
  rig.set_last_error("the bundle was made without --server: what its rig's parts said is not in it");
  replay->state.set_state(v1::SOURCE_STATE_IDLE);
  return absl::OkStatus();
}

absl::Status ReadState(Replay* replay) {
  replay->has_state = replay->bundle->Has(kBundleState);
  if (!replay->has_state) return DescribeFromSession(replay);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text,
                              ReadFile(replay->bundle->PathOf(kBundleState), kMaxStateBytes));
  const nlohmann::json state = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!state.is_object()) return Unreadable(*replay, kBundleState, "is no JSON object");
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  for (const auto& [name, message] :
       {std::pair<const char*, google::protobuf::Message*>{"rig", &replay->rig}, {"state", &replay->state}}) {
    const auto read = google::protobuf::util::JsonStringToMessage(
        state.value(name, nlohmann::json::object()).dump(), message, options);
    if (!read.ok()) return Unreadable(*replay, kBundleState, std::string(read.message()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Replay> OpenReplay(const std::string& path) {
  Replay replay;
  replay.name = std::filesystem::path(path).filename().string();
  TOUCHSTONE_ASSIGN_OR_RETURN(replay.bundle, OpenedBundle::Open(path));
  if (!replay.bundle->Has(kBundleJournal))
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": has no ", kBundleJournal, ": there is nothing to replay"));
  replay.journal = replay.bundle->PathOf(kBundleJournal);
  TOUCHSTONE_RETURN_IF_ERROR(ReadFaults(&replay));
  TOUCHSTONE_RETURN_IF_ERROR(ReadMeshes(&replay));
  TOUCHSTONE_RETURN_IF_ERROR(ReadState(&replay));
  // Whoever writes down where data are from finds it here: what is touched anew on a replay was measured once already.
  v1::RigState& rig = replay.rig;
  rig.set_provenance(absl::StrCat("replay of ", replay.name, "; ", rig.provenance()));
  rig.set_emulated(true);
  rig.set_safety_notice(absl::StrCat("REPLAY of ", replay.name,
                                     ": no hardware is opened and nothing moves. What is shown is how the "
                                     "rig was when the bundle was made; touches "
                                     "and photographs are answered from the record, and are marked as "
                                     "emulated where they are written down anew."));
  return replay;
}

}  // namespace touchstone::gateway::bundle
