#include "tests/rig/emulator_commands.h"

#include <cmath>
#include <sstream>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/rig/world/camera.h"
#include "tests/rig/world/device.h"

namespace touchstone::rig {
namespace {

nlohmann::ordered_json Numbers(const std::vector<double>& values) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const double value : values)
    out.push_back(std::isnan(value) ? nlohmann::ordered_json() : nlohmann::ordered_json(value));
  return out;
}

std::vector<double> Three(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

std::string Done(const std::string& error, const std::string& answer = "") {
  if (!error.empty()) return "error " + error;
  return answer.empty() ? "ok" : "ok " + answer;
}

}  // namespace

std::string TruthJson(const TouchTruth& truth) {
  nlohmann::ordered_json json = {{"number", truth.number},
                                 {"object", truth.object},
                                 {"up_face", truth.up_face},
                                 {"start_s", truth.start_s},
                                 {"session_time_s", truth.session_time_s},
                                 {"speed_m_s", truth.speed_m_s},
                                 {"start_in_object_m", Numbers(Three(truth.start_in_object_m))},
                                 {"approach", Numbers(Three(truth.approach))},
                                 {"lateral", Numbers(Three(truth.lateral))},
                                 {"travel_m", Numbers(truth.travel_m)},
                                 {"contact_s", Numbers(truth.contact_s)},
                                 {"reported_s", Numbers(truth.reported_s)},
                                 {"ended", truth.ended},
                                 {"emulated", true}};
  return json.dump();
}

std::string AnswerCommand(const std::string& line, Emulator* emulator, const CommandHooks& hooks) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  const std::string what = words.empty() ? "" : words[0];
  const auto has = [&](const char* name, size_t least, size_t most) {
    return what == name && words.size() >= least && words.size() <= most;
  };

  if (has("mount", 2, 3)) {
    const std::string up_face = words.size() > 2 ? words[2] : "+z";
    return Done(emulator->Mount(words[1], up_face), words[1] + " " + up_face);
  }
  if (has("unmount", 1, 1)) return Done(emulator->Mount("", "+z"));
  if (has("fault", 3, 3)) {
    char* end = nullptr;
    const double value = std::strtod(words[2].c_str(), &end);
    if (*end != '\0') return "error fault " + words[1] + ": '" + words[2] + "' is no number";
    std::string note;
    if (words[1] == "bounce" && emulator->options().sensor != "microswitch")
      note =
          "; only a microswitch bounces, and this is an emulated " + emulator->options().sensor + " sensor";
    return Done(emulator->faults().Set(words[1], value), words[1] + " = " + words[2] + note);
  }
  if (has("faults", 1, 1)) {
    std::string all;
    for (const std::string& name : Faults::Names()) {
      std::ostringstream value;
      value << emulator->faults().Get(name);
      all += (all.empty() ? "" : " ") + name + "=" + value.str();
    }
    return Done("", all);
  }
  if (has("truth", 1, 2)) {
    const std::vector<TouchTruth> touches = emulator->Touches();
    const uint64_t number = words.size() > 1 ? std::strtoull(words[1].c_str(), nullptr, 10) : 0;
    for (size_t k = touches.size(); k-- > 0;)
      if (number == 0 || touches[k].number == number) return Done("", TruthJson(touches[k]));
    return "error no such touch; there are " + std::to_string(emulator->touches());
  }
  if (has("count", 1, 2)) {
    const std::string which = words.size() > 1 ? words[1] : "touches";
    if (which == "touches") return Done("", std::to_string(emulator->touches()));
    if (which == "frames") return Done("", std::to_string(emulator->camera().frames()));
    return Done("", std::to_string(emulator->controller().Count(which)));
  }
  if (has("press", 1, 1)) return Done(emulator->faults().Set("emergency_stop", 1), "emergency stop pressed");
  if (has("release", 1, 1))
    return Done(emulator->faults().Set("emergency_stop", 0), "emergency stop released");
  if (has("reset", 1, 1)) {
    emulator->device().Reset();
    return Done("", "the emulated device begins anew");
  }
  if (has("session", 1, 1)) {
    hooks.restart_session();
    return Done("", "session time begins at the next approach");
  }
  if (has("ports", 1, 1)) return Done("", hooks.ports());
  if (has("help", 1, 1)) return Done("", kCommands);
  if (has("quit", 1, 1)) {
    hooks.quit();
    return Done("", "ending");
  }
  if (what == "hide")
    return "error what is hidden cannot be changed while it runs; start another emulator with --hide";
  return "error '" + line + "' is no command of this emulator: " + kCommands;
}

}  // namespace touchstone::rig
