// Names of people, hosts, addresses, files and secrets in texts, and what stands for them in a bug report. The same name
// gets the same alias wherever it stands; nothing tells an alias's name again.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/string_view.h>

namespace touchstone::gateway::bundle {

enum class AliasKind { kPerson, kHost, kPath, kSecret, kSession, kHidden };

// Not for several threads.
class Aliases {
 public:
  // From now on this name is replaced wherever it stands as a word of its own, in capitals or not. Names of one letter, and
  // loopback addresses, are none.
  void Learn(AliasKind kind, absl::string_view name);
  // Names of who runs this process and of this machine: user, full name, home folder, host.
  void LearnThisMachine();
  // "ana@lab rig-run 4711 (ana, operator)": person and host.
  void LearnHolder(absl::string_view holder);

  // The alias of a name: "person-1", "path-2.yaml". Always the same one.
  std::string Of(AliasKind kind, absl::string_view name);

  // The text with aliases for names that were learned, and for what looks like one: NAME@HOST, network and hardware
  // addresses, URLs with their credentials, absolute paths and those of a home folder, keys. What somebody wrote in
  // brackets behind a holder ("(cable caught)") is left out. Ports of devices (/dev/ttyACM0, /dev/video0) stay.
  std::string Text(absl::string_view text);
  // Of a text that a person wrote for people: a note, a reason. Nothing of it stays.
  std::string Note(absl::string_view text);

  // How many different names got an alias, by kind, and how many notes were left out: "persons", "hosts", ...
  std::map<std::string, int> Counts() const;

 private:
  std::string Word(absl::string_view word);
  std::string Host(absl::string_view host_and_port);
  std::string Url(absl::string_view url);
  // With the names that were learned in their place: those of one word, or those of several.
  std::string Known(absl::string_view text, bool of_words = false);

  std::map<std::pair<AliasKind, std::string>, std::string> aliases_;  // by the name in small letters
  std::map<AliasKind, int> count_;
  std::vector<std::pair<std::string, std::string>>
      learned_;  // name in small letters, alias; the longest first
  int notes_ = 0;
};

}  // namespace touchstone::gateway::bundle
