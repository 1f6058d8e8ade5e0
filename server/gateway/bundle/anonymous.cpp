#include "server/gateway/bundle/anonymous.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <absl/time/time.h>

#include <toml++/toml.h>
#include <algorithm>
#include <set>
#include <sstream>

#include "server/base/status.h"

namespace touchstone::gateway::bundle {
namespace {

// What happened to the rig soon after a session's last touch may be why it was the last.
constexpr double kAfterwardsS = 600;
// A lease comes before the session that it is for.
constexpr double kBeforeS = 60;

uint32_t BigEndian(absl::string_view bytes) {
  uint32_t value = 0;
  for (const char byte : bytes.substr(0, 4)) value = value << 8 | static_cast<unsigned char>(byte);
  return value;
}

// As the audit log writes times, so that they compare as text does.
std::string UtcText(double unix_s) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::FromUnixMillis(static_cast<int64_t>(unix_s * 1000)),
                          absl::UTCTimeZone());
}

// Keys of gateway.toml whose texts are words of this program's, and stay.
const std::set<std::string>& PlainKeys() {
  static const std::set<std::string> keys = {"arm.model", "effector.sensor", "log_level", "client_cert_role"};
  return keys;
}

std::string ConfigText(const std::string& key, const std::string& value, Aliases* aliases) {
  const bool placeholder = absl::StartsWith(value, "{") && absl::EndsWith(value, "}");  // of mount_command
  if (value.empty() || PlainKeys().count(key) > 0 || placeholder) return value;
  if (key == "provenance_note" || key == "source_note") return aliases->Note(value);
  if (key == "arm.address") {
    aliases->Learn(AliasKind::kHost, value);
    return aliases->Text(value);
  }
  if (key == "listen" || key == "metrics") return aliases->Text(absl::StrCat("http://", value)).substr(7);
  if (key == "effector.port" && absl::StartsWith(value, "/dev/tty")) return value;
  if (key == "camera.uri" || key == "camera.source") {
    const bool plain =
        value.size() <= 2 || absl::StartsWith(value, "/dev/video") || absl::StrContains(value, "://");
    return plain ? aliases->Text(value)
                 : absl::StrCat(value.substr(0, value.find(':') + 1), aliases->Of(AliasKind::kPath, value));
  }
  // "NAME=FILE,unit=mm": what is no name of a file is needed to read it.
  if (key == "mesh") {
    const std::vector<std::string> parts = absl::StrSplit(value, absl::MaxSplits(',', 1));
    const std::vector<std::string> name = absl::StrSplit(parts[0], absl::MaxSplits('=', 1));
    return absl::StrCat(aliases->Text(name[0]),
                        name.size() > 1 ? "=" + aliases->Of(AliasKind::kPath, name[1]) : "",
                        parts.size() > 1 ? "," + parts[1] : "");
  }
  return aliases->Of(AliasKind::kPath, value);
}

void AnonymiseTable(toml::table* table, const std::string& above, Aliases* aliases);

void AnonymiseNode(toml::node* node, const std::string& key, Aliases* aliases) {
  if (toml::table* const table = node->as_table()) return AnonymiseTable(table, key + ".", aliases);
  if (toml::array* const array = node->as_array()) {
    for (toml::node& element : *array) AnonymiseNode(&element, key, aliases);
    return;
  }
  if (auto* const text = node->as_string()) *text = ConfigText(key, text->get(), aliases);
}

void AnonymiseTable(toml::table* table, const std::string& above, Aliases* aliases) {
  for (auto&& [key, node] : *table) AnonymiseNode(&node, above + std::string(key.str()), aliases);
}

// Fields of an audit log's line that name who did something.
bool NamesHolder(const std::string& field) {
  return field == "who" || field == "holder" || field == "lease_holder" || field == "taken_from";
}

}  // namespace

absl::StatusOr<session::SessionContent> ReadContent(const session::Journal& journal,
                                                    const std::string& session, bool pictures) {
  session::SessionContent content;
  TOUCHSTONE_ASSIGN_OR_RETURN(content.session, journal.Session(session));
  absl::Status status;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachTouch(session, [&](const session::JournalTouch& touch) {
    const auto series = journal.Series(session, touch.id);
    status = series.status();
    if (!status.ok()) return false;
    content.series.push_back(*series);
    content.touches.push_back(touch);
    session::JournalTouch& kept = content.touches.back();
    if (kept.stage == session::TouchStage::kIntent || kept.stage == session::TouchStage::kExecuting)
      kept.stage = session::TouchStage::kFailed,
      kept.error = "this touch was under way when the bundle was made";
    return true;
  }));
  TOUCHSTONE_RETURN_IF_ERROR(status);
  if (!pictures) return content;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachImage(session, [&](const session::JournalImage& image) {
    content.images.push_back(image);
    return true;
  }));
  return content;
}

std::string AnonymousProvenance(absl::string_view provenance, Aliases* aliases) {
  size_t arm = absl::string_view::npos;
  for (const char* model :
       {"ur3 at ", "ur3e at ", "ur5e at ", "ur10e at ", "UR3 at ", "UR3e at ", "UR5e at ", "UR10e at "})
    arm = std::min(arm, provenance.rfind(model));
  if (arm == absl::string_view::npos) return aliases->Text(provenance);
  const absl::string_view note = absl::StripSuffix(provenance.substr(0, arm), "; ");
  absl::string_view rest = provenance.substr(arm);
  const size_t at = rest.find(" at ") + 4, comma = std::min(rest.find(','), rest.size());
  if (at < comma) aliases->Learn(AliasKind::kHost, rest.substr(at, comma - at));
  return absl::StrCat(note.empty() ? "" : aliases->Note(note) + "; ", aliases->Text(rest));
}

std::string WithoutTexts(const std::string& png) {
  static const std::string signature = "\x89PNG\r\n\x1a\n";
  if (png.compare(0, signature.size(), signature) != 0) return png;
  std::string kept = signature;
  size_t k = signature.size();
  while (k + 12 <= png.size()) {
    const uint64_t whole = uint64_t{BigEndian(absl::string_view(png).substr(k))} + 12;
    if (whole > png.size() - k) return png;
    const std::string type = png.substr(k + 4, 4);
    if (type != "tEXt" && type != "zTXt" && type != "iTXt" && type != "eXIf" && type != "tIME")
      kept.append(png, k, whole);
    k += whole;
  }
  return k == png.size() ? kept : png;
}

void Anonymise(session::SessionContent* content, Aliases* aliases) {
  session::JournalSession& session = content->session;
  session.provenance = AnonymousProvenance(session.provenance, aliases);
  session.name = aliases->Text(session.name);
  session.calibration = aliases->Text(session.calibration);
  for (session::JournalTouch& touch : content->touches) {
    touch.id = aliases->Text(touch.id);
    touch.object = aliases->Text(touch.object);
    touch.error = aliases->Text(touch.error);
  }
  for (session::JournalImage& image : content->images) {
    image.id = aliases->Text(image.id);
    image.object = aliases->Text(image.object);
    image.png = WithoutTexts(image.png);
  }
}

std::vector<nlohmann::ordered_json> LinesOf(const std::string& log, const session::SessionContent& content) {
  double end_s = content.session.created_unix_s;
  for (const session::JournalTouch& touch : content.touches)
    end_s = std::max(end_s, touch.result.start_unix_s);
  for (const session::JournalImage& image : content.images) end_s = std::max(end_s, image.unix_s);
  const std::string from = UtcText(content.session.created_unix_s - kBeforeS);
  std::string to = UtcText(end_s + kAfterwardsS);
  std::vector<nlohmann::ordered_json> all;
  for (const absl::string_view text : absl::StrSplit(log, '\n', absl::SkipEmpty())) {
    // A line that a power cut left half is passed over.
    nlohmann::ordered_json line = nlohmann::ordered_json::parse(text, nullptr, /*allow_exceptions=*/false);
    if (!line.is_object() || !line.contains("time") || !line["time"].is_string()) continue;
    const bool of_it = line.value("session", nlohmann::ordered_json()) == content.session.name;
    if (of_it) to = std::max(to, line["time"].get<std::string>());
    if (of_it || !line.contains("session")) all.push_back(std::move(line));
  }
  std::vector<nlohmann::ordered_json> lines;
  for (nlohmann::ordered_json& line : all) {
    const std::string time = line["time"];
    if (line.contains("session") || (time >= from && time <= to)) lines.push_back(std::move(line));
  }
  return lines;
}

void LearnFrom(const std::vector<nlohmann::ordered_json>& lines, Aliases* aliases) {
  for (const nlohmann::ordered_json& line : lines)
    for (const auto& [field, value] : line.items())
      if (NamesHolder(field) && value.is_string()) aliases->LearnHolder(value.get<std::string>());
      // It stands in other texts again. One word alone may be a word of this program's.
      else if (field == "reason" && value.is_string() && absl::StrContains(value.get<std::string>(), ' '))
        aliases->Learn(AliasKind::kHidden, value.get<std::string>());
}

void Anonymise(std::vector<nlohmann::ordered_json>* lines, Aliases* aliases) {
  for (nlohmann::ordered_json& line : *lines)
    for (const auto& [field, value] : line.items()) {
      if (!value.is_string() || field == "time" || field == "event") continue;
      const std::string text = value;
      value = field == "reason" ? aliases->Note(text) : aliases->Text(text);
    }
}

absl::StatusOr<std::string> AnonymousConfig(const std::string& text, const std::string& origin,
                                            Aliases* aliases) {
  toml::table table;
  try {
    table = toml::parse(text, origin);
  } catch (const toml::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ":", error.source().begin.line, ": ",
                                                   std::string(error.description()),
                                                   "; name the file that the gateway was started with"));
  }
  AnonymiseTable(&table, "", aliases);
  std::ostringstream written;
  written << table << "\n";
  return written.str();
}

void Anonymise(nlohmann::ordered_json* state, Aliases* aliases) {
  if (state->is_string()) {
    *state = aliases->Text(state->get<std::string>());
    return;
  }
  if (!state->is_structured()) return;
  for (const auto& [key, value] : state->items()) {
    if (key == "provenance" && value.is_string())
      value = AnonymousProvenance(value.get<std::string>(), aliases);
    else
      Anonymise(&value, aliases);
  }
}

}  // namespace touchstone::gateway::bundle
