// For tests: a CA and certificates of it, made by the openssl command.
#pragma once

#include <cstdlib>
#include <fstream>
#include <string>

#include "server/base/check.h"
#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::service {

class TestCertificates {
 public:
  TestCertificates() { MakeCa("ca"); }

  // `name`.pem and `name`.key of a new CA.
  void MakeCa(const std::string& name) const {
    Run("openssl req -x509 " + kKey + " -keyout " + name + ".key -out " + name +
        ".pem -days 2 -subj /CN=" + name);
  }
  // The same, signed by `ca`; `names` as openssl takes them, "DNS:localhost,IP:127.0.0.1".
  void Issue(const std::string& name, const std::string& names, const std::string& ca = "ca") const {
    std::ofstream(Path(name + ".ext")) << "subjectAltName=" << names << "\n";
    Run("openssl req " + kKey + " -keyout " + name + ".key -out " + name + ".csr -subj /CN=" + name);
    Run("openssl x509 -req -in " + name + ".csr -CA " + ca + ".pem -CAkey " + ca +
        ".key -CAcreateserial -days 2 -extfile " + name + ".ext -out " + name + ".pem");
  }

  std::string Path(const std::string& file) const { return folder_.Path(file); }
  std::string Text(const std::string& file) const { return ReadFile(Path(file)).value(); }

 private:
  void Run(const std::string& command) const {
    TOUCHSTONE_CHECK(std::system(("cd '" + folder_.path() + "' && " + command + " 2>/dev/null").c_str()) ==
                     0);
  }

  const std::string kKey = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes";
  TestFolder folder_;
};

}  // namespace touchstone::service
