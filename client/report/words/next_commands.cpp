#include "client/report/words/next_commands.h"

#include <algorithm>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

namespace touchstone::client {
namespace {

constexpr char kBetter[] = "better.yaml";
// Options of diagnose that other commands do not have, or that name what this run has written.
const std::vector<std::string> kOwnOptions = {"--json", "--html", "--save-model", "--keep-as"};
const std::vector<std::string> kOwnFlags = {
    "--force", "--with-formula", "--with-surface-map", "-q", "--quiet", "-v", "--verbose"};

bool Holds(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

// Words of a command as ShellCommand writes it, still quoted.
std::vector<std::string> Words(const std::string& command) {
  std::vector<std::string> words(1);
  bool quoted = false, escaped = false;
  for (const char c : command) {
    if (c == ' ' && !quoted && !escaped) {
      words.emplace_back();
      continue;
    }
    words.back() += c;
    if (!escaped && c == '\'') quoted = !quoted;
    escaped = !escaped && !quoted && c == '\\';
  }
  return words;
}

class Follower {
 public:
  explicit Follower(const v1::Report& report) {
    const std::vector<std::string> words = Words(report.provenance().command());
    if (words.size() < 3 || words[0] != "touchstone" || words[1] != "diagnose") return;
    known_ = true;
    for (size_t i = 2; i < words.size(); ++i) {
      const std::string name = words[i].substr(0, words[i].find('='));
      if (Holds(kOwnFlags, words[i])) continue;
      if (!Holds(kOwnOptions, name)) {
        rest_.push_back(words[i]);
        continue;
      }
      const bool apart = name == words[i];
      std::string* const written = name == "--save-model" ? &saved_ : name == "--keep-as" ? &kept_ : nullptr;
      if (written != nullptr)
        *written = !apart ? words[i].substr(name.size() + 1) : i + 1 < words.size() ? words[i + 1] : "";
      i += apart;
    }
  }

  bool known() const { return known_; }
  bool saved() const { return !saved_.empty() || !kept_.empty(); }

  std::string Save(const std::string& further) const {
    return absl::StrCat("touchstone diagnose ", absl::StrJoin(rest_, " "), " --save-model ", kBetter,
                        further);
  }
  std::string Compare() const {
    std::vector<std::string> words;
    for (size_t i = 0; i < rest_.size(); ++i) {
      if (absl::StartsWith(rest_[i], "--model")) {
        i += rest_[i] == "--model";
        continue;
      }
      words.push_back(rest_[i]);
    }
    return absl::StrCat("touchstone compare ", absl::StrJoin(words, " "), " --model ",
                        !saved_.empty()  ? saved_
                        : !kept_.empty() ? kept_
                                         : kBetter);
  }
  std::string Propose(bool pictures) const {
    return absl::StrCat("touchstone propose ", absl::StrJoin(rest_, " "), " -o ",
                        pictures ? "next.csv" : "plan.csv");
  }

 private:
  bool known_ = false;
  std::vector<std::string> rest_;  // words of the command that others take too
  std::string saved_, kept_;       // the file, or the name at the server
};

}  // namespace

std::vector<NextCommand> NextCommands(const v1::Report& report) {
  const Follower follower(report);
  std::vector<NextCommand> commands;
  const bool boards = report.data_size() > 0 && report.data(0).kind() == v1::DataReport::BOARDS;
  const bool poses = report.data_size() > 0 && report.data(0).kind() != v1::DataReport::DISTRIBUTIONS;
  if (!follower.known() || boards || report.verdict() == v1::Report::CHECK_DATA) return commands;
  if (!report.improved_model_yaml().empty()) {
    if (!follower.saved()) commands.push_back({"Save the improved model", follower.Save("")});
    commands.push_back({"Compare it with the same data", follower.Compare()});
  }
  const bool suggests =
      std::any_of(report.data().begin(), report.data().end(),
                  [](const v1::DataReport& data) { return !data.unexplained().model_yaml().empty(); });
  if (suggests) commands.push_back({"Save the model with the suggestion", follower.Save(" --with-formula")});
  if (!poses || report.data_size() > 1) return commands;
  const bool pictures = report.data(0).kind() == v1::DataReport::PHOTOGRAPHS;
  commands.push_back(
      {pictures ? "Propose pictures that would tell more" : "Propose touches that would tell more",
       follower.Propose(pictures)});
  return commands;
}

}  // namespace touchstone::client
