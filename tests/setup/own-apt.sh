# shellcheck shell=sh
# An apt state of its own in this folder, of another suite, or for another architecture, of the Debian that this machine's apt
# has: own_apt deb|deb-src SUITE [ARCHITECTURE]. This machine's own packages stay what they are.

own_apt() {
    # shellcheck disable=SC2016 # it is apt that fills it in
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Codename: bookworm' | head -n 1)
    mkdir -p state/lists/partial cache/archives/partial
    echo "$1 [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] ${mirror:?no Debian 12 in the sources of apt} $2 main" >sources.list
    cat >apt.conf <<END
Dir::Etc::sourcelist "$PWD/sources.list";
Dir::Etc::sourceparts "/dev/null";
Dir::State::lists "$PWD/state/lists";
Dir::Cache "$PWD/cache";
APT::Sandbox::User "";
END
    if [ -n "${3:-}" ]; then
        cat >>apt.conf <<END
APT::Architecture "$3";
APT::Architectures "$3";
Dir::State::status "/dev/null";
END
    fi
    export APT_CONFIG="$PWD/apt.conf"
    apt-get -q update >log 2>&1
}
