/* Lines and files: how they may be written, and what people and their programs do to them. */
#include "base/utf8.h"
#include "config_helper.h"

/* ---- lines ---- */

static void ways_to_write_a_line(void **state)
{
    static const char *const lines[] = {
        "[basic_id]\nuas_id=ABCD1X",
        "[basic_id]\r\nuas_id = ABCD1X\r\n",
        "[basic_id]\ruas_id = ABCD1X\r",
        "\xEF\xBB\xBF[basic_id]\nuas_id = ABCD1X\n",
        "\xEF\xBB\xBF; first\r\n[basic_id]\r\nuas_id = ABCD1X",
        "# comment\n; comment\n\n  [ basic_id ] ; c\n\t uas_id\t=\t\"ABCD1X\"\t; c\n",
        "[BASIC_ID]\nUAS_ID: 'ABCD1X';c\n",
        "[basic_id]\n[mavlink]\n[basic_id] # again\n    uas_id = ABCD1X\n",
        "[basic_id]\nid_type = serial\n   uas_id = ABCD1X\n", /* indented: no continuation */
        "[basic_id]\nuas_id = \" ABCD1X \"\n",
    };

    (void)state;
    for (size_t i = 0; i < COUNT(lines); i++) {
        expect(lines[i], "");
        assert_string_equal(config.basic_id[0].uas_id, "ABCD1X");
    }
}

static void quotes_and_comments(void **state)
{
    static const struct {
        const char *value, *description;
    } cases[] = {
        {"\"Boat; red\" ; comment", "Boat; red"},
        {"'Boat = \"red\"'", "Boat = \"red\""},
        {"Peter's boat ; comment", "Peter's boat"},
        {"Boat #3", "Boat #3"},
        {"a;b", "a"},
        {"; all comment", ""},
        {"\"it's\" # c", "it's"},
        {"[not a section]", "[not a section]"},
        {"a:b=c", "a:b=c"},
    };
    char text[96];

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        snprintf(text, sizeof(text), "[self_id]\ndescription = %s\n", cases[i].value);
        expect(text, "");
        assert_string_equal(config.description, cases[i].description);
    }
}

/* What people and their programs do to a file. */
static void wrong_files(void **state)
{
    static const struct {
        const char *text, *sentences;
    } cases[] = {
        {"", "error: odid.conf: is empty; nothing in it is used\n"},
        {"{\\rtf1\\ansi", "error: odid.conf: is a word processor's file (RTF); save it as plain "
                          "text; nothing in it is used\n"},
        {"PK\x03\x04zip", "error: odid.conf: is a word processor's file or an archive; save it as "
                          "plain text; nothing in it is used\n"},
        {"<html>", "error: odid.conf: is HTML or XML; save it as plain text; nothing in it is "
                   "used\n"},
        {"[basic_id", "error: odid.conf line 1: [basic_id: the closing ] is missing; taken as "
                      "[basic_id]\n"},
        {"[basic_id]\nuas_",
         "error: odid.conf line 2: neither [section] nor key = value; ignored\n"},
        {"[basic_id]\nuas_id = \"ABCD1X",
         "error: odid.conf line 2: uas_id: the closing quote is missing; taken up to the end of "
         "the line\n"},
        {"[basic_id]\n= ABCD1X\n",
         "error: odid.conf line 2: neither [section] nor key = value; ignored\n"},
        {"[basic_id]\nuas_id = \"ABCD1X\" and more\n",
         "error: odid.conf line 2: uas_id: what follows the closing quote is ignored\n"},
        {"[basic_id] uas_id = X\n",
         "error: odid.conf line 1: [basic_id]: what follows in the same line is ignored\n"},
        {"[basic_id]\nuas_id = \xE2\x80\x9C"
         "ABCD1X\xE2\x80\x9D\n",
         "warning: odid.conf line 2: uas_id: typographic quotes, as a word processor makes them; "
         "use \"\"\n"},
        {"[basic_id]\nuas_id = \xE2\x80\x9D"
         "ABCD1X\xE2\x80\x9D\n",
         "warning: odid.conf line 2: uas_id: typographic quotes, as a word processor makes them; "
         "use \"\"\n"},
        {"uas_id = ABCD1X\n",
         "error: odid.conf line 1: uas_id belongs in [basic_id]; ignored here\n"},
        {"[mavlink]\nuas_id = ABCD1X\n",
         "error: odid.conf line 2: uas_id belongs in [basic_id]; ignored here\n"},
        {"[sytem]\ncategory = open\nclass = C1\n",
         "error: odid.conf line 1: [sytem]: unknown section, ignored with all its keys; did you "
         "mean [system]?\n"},
        {"[wireless]\nx = 1\n",
         "error: odid.conf line 1: [wireless]: unknown section, ignored with all its keys\n"},
        {"[maintenance password = geheim123]\nx = 1\n",
         "error: odid.conf line 1: [maintenance]: unknown section, ignored with all its keys\n"},
        {"[mavlink]\nbuad = 57600\n",
         "error: odid.conf line 2: [mavlink] buad: unknown key, ignored; did you mean baud?\n"},
        {"[basic_id]\nuas-id = ABCD1X\n", "error: odid.conf line 2: [basic_id] uas-id: unknown "
                                          "key, ignored; did you mean uas_id?\n"},
        {"[basic_id]\nweight = 5\n", "error: odid.conf line 2: [basic_id] weight: unknown key, "
                                     "ignored\n"},
        {"[basic_id]\nuas_id ABCD1X\n",
         "error: odid.conf line 2: neither [section] nor key = value; ignored\n"},
        {"\x89PNG\r\n", "error: odid.conf line 1: neither [section] nor key = value; ignored\n"},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        expect(cases[i].text, cases[i].sentences);
    }
    parse("[basic_id]\nuas_id = \"ABCD1X");
    assert_string_equal(config.basic_id[0].uas_id, "ABCD1X"); /* better than silence */
    parse("[basic_id]\nuas_id = \xE2\x80\x9C"
          "ABCD1X\xE2\x80\x9D\n");
    assert_string_equal(config.basic_id[0].uas_id, "ABCD1X");
}

/* A refused address goes into log and status. */
static void a_refused_address_shows_no_password(void **state)
{
    static const struct {
        const char *written, *shown;
    } cases[] = {
        {"ftp://user:geheim@example.org/", "ftp://...@example.org/"},
        {"https://user:geh@eim@example.org/", "https://...@example.org/"},
        {"https:/user:geheim@example.org/", "...@example.org/"},
        {"user:geheim@example.org", "...@example.org"},
        {"user:geheim://@example.org", "...@example.org"},
        {"user:geheim@https://example.org", "...@https://example.org"},
    };
    char text[256], sentence[256];

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        snprintf(text, sizeof(text), "[update]\nhawkbit_url = %s\n", cases[i].written);
        snprintf(sentence, sizeof(sentence),
                 "error: odid.conf line 2: [update] hawkbit_url = \"%s\": expected an address such "
                 "as https://updates.example.org:8443, or \"\"; using none\n",
                 cases[i].shown);
        expect(text, sentence);
    }
    expect(
        "[broadcast]\nbt_adapter = h4:/dev/ttyUSB0@fast\n",
        "error: odid.conf line 2: [broadcast] bt_adapter = \"h4:/dev/ttyUSB0@fast\": expected hciN "
        "such as hci0, or h4:/dev/ttyX[@baud]; using hci0\n");
}

static void wrong_bytes(void **state)
{
    static const char utf16_le[] = "\xFF\xFE[\0b\0]\0\n";
    static const char utf16_be[] = "\xFE\xFF\0[\0b\0]";
    static const char utf16_bare[] = "[\0b\0a\0s\0i\0c\0_\0i\0d\0]\0";
    static const char resource[] = "\0\x05\x16\x07\0\2\0\0Mac OS X";
    static const char zeros[512] = {0};
    static const char tail[] = "[basic_id]\nuas_id = ABCD1X\nua_type = gl\0\0\0\0\0\0\0\0";
    static const char utf16[] = "error: odid.conf: is UTF-16 text; save it as UTF-8 (Notepad: "
                                "Encoding: UTF-8); nothing in it is used\n";

    (void)state;
    assert_int_equal(parse_bytes(utf16_le, sizeof(utf16_le)), 1);
    assert_string_equal(reports.text, utf16);
    assert_int_equal(parse_bytes(utf16_be, sizeof(utf16_be)), 1);
    assert_string_equal(reports.text, utf16);
    assert_int_equal(parse_bytes(utf16_bare, sizeof(utf16_bare) - 1), 1);
    assert_string_equal(reports.text, utf16);
    expect_defaults();
    parse_bytes(resource, sizeof(resource));
    assert_string_equal(reports.text, "error: odid.conf: is a \"._\" file that macOS puts beside "
                                      "the real one; nothing in it is used\n");
    parse_bytes(zeros, sizeof(zeros));
    assert_string_equal(reports.text, "error: odid.conf: holds only NUL bytes, as after a power "
                                      "cut; nothing in it is used\n");
    parse_bytes(tail, sizeof(tail));
    assert_string_equal(reports.text,
                        "error: odid.conf line 3: holds NUL bytes, as a damaged file does; "
                        "ignored\n");
    assert_string_equal(config.basic_id[0].uas_id, "ABCD1X");
}

static void long_lines(void **state)
{
    char text[1200] = "[self_id]\ndescription = Boat ; ";
    size_t length = strlen(text);

    (void)state;
    memset(text + length, 'c', 1000); /* a long comment is no fault */
    expect(text, "");
    assert_string_equal(config.description, "Boat");
    memset(text + strlen("[self_id]\n"), ' ', 900); /* nor is a long indent, but it hides the key */
    memcpy(text + 910, "description = x\n", 17);
    expect(text, "");
    memset(text + 924, 'x', 200);
    text[1124] = '\0';
    expect(text, "error: odid.conf line 2: description: the line is too long; ignored\n");
    strcpy(text, "[self_id]\n");
    memset(text + 10, 'k', 300);
    strcpy(text + 310, " = x\n");
    parse(text);
    assert_int_equal(reports.errors, 1);
}

/* A line of every length around the parser's limit, and noise. */
static void nothing_breaks_it(void **state)
{
    char text[600];

    (void)state;
    for (size_t length = 150; length < 300; length++) {
        int head = snprintf(text, sizeof(text), "[daemon]\nuser = odid\n[self_id]\ndescription = ");

        memset(text + head, 'd', length);
        strcpy(text + head + length, "\n[mavlink]\nudp_port = 1\n");
        parse(text);
        assert_int_equal(config.udp_port, 1);
    }
    srand(1);
    for (int round = 0; round < 3000; round++) {
        size_t length = (size_t)rand() % sizeof(text);

        for (size_t i = 0; i < length; i++) {
            text[i] = "[]=;#\"' \n\ra-\xC3\xA5\x01\xE2\x80\x9C_i\0"[rand() % 22];
        }
        parse_bytes(text, length);
        assert_true(reports.count <= CONFIG_SENTENCES_MAX + 1);
    }
}

static void sentences_end_after_fifty(void **state)
{
    char text[4096] = "[basic_id]\n";

    (void)state;
    for (int i = 0; i < 200; i++) {
        strcat(text, "x = 1\n");
    }
    assert_int_equal(parse(text), 200);
    assert_int_equal(reports.count, CONFIG_SENTENCES_MAX + 1);
    assert_non_null(strstr(reports.text, "error: odid.conf line 52: more is wrong than is listed "
                                         "here\n"));
}

/* Every sentence is complete in its place, and UTF-8, whatever was quoted. */
static void sentences_are_utf8(void **state)
{
    char text[400];

    (void)state;
    for (int byte = 1; byte < 256; byte++) {
        if (byte == '\n' || byte == '\r') {
            continue;
        }
        snprintf(text, sizeof(text), "[mavlink]\nsource = %c%c\nx%c = 1\n[z%c]\n", byte, byte, byte,
                 byte);
        parse(text);
        assert_true(reports.count >= 1);
        for (const char *c = reports.text; *c != '\0'; c += utf8_character(c)) {
            assert_true(*c == '\n' || utf8_character(c) > 0);
            assert_true((unsigned char)*c >= ' ' || *c == '\n');
        }
    }
}

/* ---- files ---- */

static void files(void **state)
{
    static char large[65537];
    char sentence[128];

    (void)state;
    assert_int_equal(read_file("absent.conf"), 1);
    snprintf(sentence, sizeof(sentence),
             "error: %s/absent.conf: can't be read: No such file or "
             "directory\n",
             directory);
    assert_string_equal(reports.text, sentence);
    assert_int_equal(read_file(""), 1);
    assert_non_null(strstr(reports.text, "Is a directory"));

    write_file("odid.conf", "[mavlink]\nudp_port = 0\n", 23);
    assert_int_equal(read_file("odid.conf"), 1);
    assert_string_equal(reports.text,
                        "error: odid.conf line 2: [mavlink] udp_port = \"0\": expected "
                        "1-65535; using 14550\n");
    write_file("odid.conf", "", 0);
    assert_int_equal(read_file("odid.conf"), 1);
    assert_string_equal(reports.text, "error: odid.conf: is empty; nothing in it is used\n");

    memset(large, '\n', sizeof(large));
    memcpy(large, "[mavlink]\nudp_port = 1\n", 23);
    write_file("odid.conf", large, sizeof(large));
    assert_int_equal(read_file("odid.conf"), 1);
    assert_non_null(
        strstr(reports.text, "odid.conf: is larger than 64 KiB; nothing in it is used"));
    expect_defaults();
    write_file("odid.conf", large, sizeof(large) - 1);
    assert_int_equal(read_file("odid.conf"), 0);
    assert_int_equal(config.udp_port, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ways_to_write_a_line),
        cmocka_unit_test(quotes_and_comments),
        cmocka_unit_test(wrong_files),
        cmocka_unit_test(a_refused_address_shows_no_password),
        cmocka_unit_test(wrong_bytes),
        cmocka_unit_test(long_lines),
        cmocka_unit_test(nothing_breaks_it),
        cmocka_unit_test(sentences_end_after_fifty),
        cmocka_unit_test(sentences_are_utf8),
        cmocka_unit_test(files),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
