// Rows of a JSON report: flat objects of numbers, words and truths.
#pragma once
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

namespace glint::bench {

class Row {
 public:
  Row& word(const char* key, const std::string& value) { return add(key, '"' + value + '"'); }
  Row& truth(const char* key, bool value) { return add(key, value ? "true" : "false"); }
  Row& number(const char* key, double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return add(key, std::isfinite(value) ? text : "null");
  }
  std::string text() const { return "{" + text_ + "}"; }

 private:
  Row& add(const char* key, const std::string& value) {
    text_ += (text_.empty() ? "\"" : ", \"") + std::string(key) + "\": " + value;
    return *this;
  }
  std::string text_;
};

/// One object: the head's keys, then lists of rows by name.
struct Report {
  Row head;
  std::map<std::string, std::vector<Row>> lists;

  std::string text() const {
    std::string json = "{\"head\": " + head.text();
    for (const auto& [name, rows] : lists) {
      json += ",\n\"" + name + "\": [";
      for (size_t k = 0; k < rows.size(); ++k) json += (k ? ",\n  " : "\n  ") + rows[k].text();
      json += "]";
    }
    return json + "}\n";
  }
};

}  // namespace glint::bench
